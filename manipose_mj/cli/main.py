"""The `manipose` command."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Sequence

from manipose_mj.cli import (
    card,
    demo,
    demos,
    doctor,
    evaluate,
    render,
    robustness,
    tasks,
    view,
)
from manipose_mj.cli.assets.app import build_app as build_assets_app
from manipose_mj.cli.pose.app import build_app as build_pose_app
from manipose_mj.cli.protocol import build_app as build_protocol_app
from manipose_mj.cli.train import build_app as build_train_app
from manipose_mj.console.command_line import CommandApp, parse
from manipose_mj.errors import InputError, WorkerDiedError

DESCRIPTION = "A MuJoCo benchmark for pose-aware robot manipulation."
EXIT_FAILED, EXIT_INPUT, EXIT_INTERRUPTED, EXIT_PIPE = 1, 2, 130, 141


def build_app() -> CommandApp:
    """Every subcommand; each loads what it needs only when it runs."""
    app = CommandApp()
    app.add("demo", demo.demo)
    app.add("evaluate", evaluate.evaluate)
    app.add("robustness", robustness.robustness)
    app.add("card", card.card)
    app.add("list", tasks.list_tasks)
    app.add("render", render.render)
    app.add("view", view.view)
    app.add("assets", build_assets_app(), "Build, check and inspect object assets.")
    app.add("demos", demos.build_app(), "Record demonstrations, replay and export them.")
    app.add("pose", build_pose_app(), "Train, evaluate and score pose estimators.")
    app.add("train", build_train_app(), "Learn policies on batched worlds.")
    app.add("protocol", build_protocol_app(), "Certify that a protocol's starts can be solved.")
    app.add("doctor", doctor.doctor)
    return app


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return the exit code.

    0: done; 1: done, and something failed a check; 2: the input or its place on disk was wrong;
    130: interrupted.
    """
    try:
        run = parse(build_app(), argv, prog="manipose", description=DESCRIPTION)
        return run() or 0
    except InputError as error:
        return _fail(str(error), EXIT_INPUT)
    except WorkerDiedError as error:
        return _fail(str(error), EXIT_FAILED)
    except MemoryError as error:
        said = f" ({error})" if str(error) else ""
        return _fail(f"out of memory{said}", EXIT_FAILED)
    except KeyboardInterrupt as interrupt:
        kept = str(interrupt) or "whole results, if there are any yet, are kept"
        return _fail(f"interrupted; {kept}", EXIT_INTERRUPTED)
    except BrokenPipeError:
        # The reader of a pipe has left: the interpreter must not complain about it at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return EXIT_PIPE
    except OSError as error:
        if error.errno is None or error.errno == errno.EBADF:
            raise
        where = f"{error.filename}: " if error.filename is not None else ""
        return _fail(f"{where}{error.strerror}", EXIT_INPUT)


def _fail(message: str, code: int) -> int:
    from manipose_mj.console import output

    output.fail_line(message)
    return code


if __name__ == "__main__":
    sys.exit(main())
