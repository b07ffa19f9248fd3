"""Kernels in modules of their own, and a function that launches them."""

import warp as wp  # pyright: ignore[reportMissingImports]


def _adding(number: int) -> wp.Kernel:
    @wp.kernel(module="unique", enable_backward=False)
    def add(values: wp.array[float]):
        values[wp.tid()] = values[wp.tid()] + float(wp.static(number))

    return add


KERNELS = [_adding(number) for number in range(5)]


def launch_all(size: int) -> wp.array:
    """Each kernel once; one of them in a loop that ends when the values say so."""
    values = wp.zeros(size, dtype=float, device="cpu")
    for kernel in KERNELS[:-1]:
        wp.launch(kernel, size, inputs=[values], device="cpu")
    going = wp.ones(1, dtype=int, device="cpu")

    def body(given: wp.array) -> None:
        wp.launch(KERNELS[-1], size, inputs=[given], block_dim=64, device="cpu")

    wp.capture_while(going, while_body=body, given=values)
    return values
