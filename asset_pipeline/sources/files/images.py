"""Images of any depth and mode as red, green and blue, and why one cannot be read."""

from __future__ import annotations

import re

import numpy as np
from PIL import Image


def as_rgb(image: Image.Image) -> Image.Image:
    """With 8 bits a channel; 16 bits are scaled, which Pillow would clip."""
    if image.mode.startswith("I"):
        levels = np.asarray(image).astype(float)
        # Of 32 bits, as older Pillows read 16, nobody says how many are used.
        most = 65535.0 if ";16" in image.mode or levels.max(initial=0) > 255 else 255.0
        image = Image.fromarray(np.uint8(np.clip(levels / most, 0, 1) * 255 + 0.5))
    return image.convert("RGB")


def why_unreadable(error: Exception) -> str:
    """One phrase; each of Pillow's readers fails in its own way."""
    reason = (str(error).splitlines() or [type(error).__name__])[0]
    if isinstance(error, Image.DecompressionBombError):
        found, most = re.findall(r"\d+", reason)[:2]
        return f"{int(found) / 1e6:.0f} megapixels; expected at most {int(most) / 1e6:.0f}: make it smaller"
    return reason
