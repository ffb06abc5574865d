"""The moving picture on the first page: `python -m tests.viewing.moving_picture`, with Chromium installed."""

import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

from gantrytau import animate
from gantrytau.commands.demo.motion_problems import SixLinks
from gantrytau_optimica import optimize
from tests.viewing.browser import browsing, found

FILE = Path(__file__).parents[2] / "notebooks" / "figures" / "six_links_in_motion.webp"
WIDTH, HEIGHT, TABLE = 1100, 760, 60  # pixels, the last those of the slider
PICTURES, EACH, LAST = 50, 42, 900  # ms
MARGIN = 20  # pixels


def main() -> None:
    """Film the fastest motion of the six-link robot, five times slower, and crop it to what moves."""
    browser = found()
    if browser is None:
        raise SystemExit("found no Chromium or Chrome; apt install chromium")
    with tempfile.TemporaryDirectory() as folder, browsing(browser) as tab:
        page = animate(optimize(SixLinks, elements=20), speed=0.2)
        tab.resize(WIDTH, HEIGHT)
        tab.open(page.save(Path(folder) / "move.html"))
        tab.quieten()
        tab.pause()
        shares = np.linspace(0.002, 0.998, PICTURES)
        pictures = np.array([tab.picture_at(float(share))[: HEIGHT - TABLE] for share in shares])
    coloured = (np.ptp(pictures, axis=3) > 40).any(axis=0)
    rows, columns = (np.flatnonzero(coloured.any(axis=k)) for k in (1, 0))
    top, left = max(rows[0] - MARGIN, 0), max(columns[0] - MARGIN, 0)
    cropped = pictures[:, top : rows[-1] + MARGIN, left : columns[-1] + MARGIN].astype(np.uint8)
    first, *others = [Image.fromarray(picture) for picture in cropped]
    times = [*[EACH] * (PICTURES - 1), LAST]
    first.save(FILE, save_all=True, append_images=others, duration=times, loop=0, quality=70, method=6)
    print(f"{FILE}: {FILE.stat().st_size / 1e6:.2f} MB, {first.size[0]} x {first.size[1]} pixels")


if __name__ == "__main__":
    main()
