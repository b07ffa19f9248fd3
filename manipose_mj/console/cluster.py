"""Joblib's work on the workers of a dask cluster."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from manipose_mj.errors import InputError, WorkerDiedError, how_to_install

WAIT_FOR_WORKERS = 10.0  # [s]


@contextmanager
def cluster(address: str | None) -> Iterator[None]:
    """Run joblib's work on a dask cluster, if there is an address.

    Args:
      address: Of the scheduler, such as `"tcp://10.0.0.1:8786"`.

    Raises:
      InputError: `dask.distributed` is not installed, nobody answers, or the scheduler has no workers.
      WorkerDiedError: On leaving. One task after the other killed its worker.
    """
    if address is None:
        yield
        return
    try:
        from distributed import Client, KilledWorker
    except ImportError:
        raise InputError(f"--dask needs dask.distributed; {how_to_install('cluster')}") from None
    import joblib

    try:
        client = Client(address)
    except (OSError, ValueError) as error:
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise InputError(f"--dask {address}: no scheduler answers ({reason})") from None
    with client:
        try:
            client.wait_for_workers(1, timeout=WAIT_FOR_WORKERS)
        except TimeoutError:
            raise InputError(
                f"--dask {address}: no worker within {WAIT_FOR_WORKERS:g} s; start some there"
            ) from None
        try:
            with joblib.parallel_config(backend="dask"):
                yield
        except KilledWorker as error:
            reason = " ".join(str(error).split())[:200]
            raise WorkerDiedError(f"a worker of {address} died ({reason})") from None
