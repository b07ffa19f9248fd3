"""A local endpoint that answers as a language model's does, with one behaviour after the other."""

from __future__ import annotations

import json
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

from manipose_mj.control.language.description import scene_text
from manipose_mj.control.language.destinations import named_destinations
from manipose_mj.control.language.endpoint import EndpointModel
from manipose_mj.control.language.planner import LanguagePlanner
from manipose_mj.control.language.reply import reply_schema
from tests.control.language.scenes import kitchen

KEY = "sk-secret-of-this-test"
GOOD = json.dumps(
    {
        "plan": [
            {"primitive": "grasp_at", "subject": "top_drawer"},
            {"primitive": "move_to", "subject": "top_drawer", "opening": 0.19},
            {"primitive": "release", "subject": "top_drawer"},
        ],
        "refusal": "",
    }
)


class Server:
    """Answers with one behaviour after the other; remembers what it was asked."""

    def __init__(self, behaviours: list) -> None:
        self.behaviours, self.requests = behaviours, []
        outer = self

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                length = int(self.headers["Content-Length"])
                outer.requests.append(json.loads(self.rfile.read(length)))
                outer.behaviours.pop(0)(self)

            def log_message(self, *_) -> None: ...

        self._server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self._server.server_port}/v1"
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def close(self) -> None:
        self._server.shutdown()
        self._server.server_close()


def says(text: str | list | None, **message):
    """Answer as an endpoint does."""

    def answer(handler: BaseHTTPRequestHandler) -> None:
        choice = {
            "index": 0,
            "finish_reason": "stop",
            "message": {"role": "assistant", "content": text, **message},
        }
        body = {"id": "1", "object": "chat.completion", "created": 0, "model": "m"}
        send(handler, 200, json.dumps({**body, "choices": [choice]}))

    return answer


def status(code: int, **headers):
    return lambda handler: send(handler, code, '{"error": {"message": "no"}}', **headers)


def send(handler: BaseHTTPRequestHandler, code: int, body: str, **headers) -> None:
    handler.send_response(code)
    handler.send_header("Content-Type", "application/json")
    handler.send_header("Content-Length", str(len(body)))
    for name, value in headers.items():
        handler.send_header(name.replace("_", "-"), value)
    handler.end_headers()
    handler.wfile.write(body.encode())


def refuses(parameter: str, message: str = ""):
    """Answers as an endpoint that does not take a parameter."""
    words = message or f"Unsupported value: '{parameter}' does not support this"
    body = json.dumps({"error": {"message": words, "param": parameter, "code": "unsupported"}})
    return lambda handler: send(handler, 400, body)


def asked(server: Server, tmp_path, *, timeout: float = 20.0, retries: int = 1):
    """What comes of an instruction, and the file of exchanges."""
    estimate, path = kitchen(), tmp_path / "exchanges.jsonl"
    model = EndpointModel("m", server.url, timeout=timeout, retries=retries)
    planner = LanguagePlanner(model, "Open the top drawer.", path)
    destinations = named_destinations((), estimate)
    messages = planner.question(scene_text(estimate, destinations))
    schema = reply_schema(estimate, destinations)
    return lambda: planner.steps(messages, schema, estimate, destinations), path
