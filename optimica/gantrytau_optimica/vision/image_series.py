"""The images of one camera, one by one: of a folder or of an array, as grey values on the scale of 8 bits."""

import os
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gantrytau import ModelError
from gantrytau_optimica.vision.image_files import ENDINGS, read_image

Array = np.ndarray
SCALE = {np.dtype(np.uint8): 1.0, np.dtype(np.uint16): 255 / 65535}
LIGHTNESS = np.array([0.114, 0.587, 0.299], dtype=np.float32)  # of blue, green, red (BT.601)
SPARSE = 4  # times the files: as many numbers, with gaps, have a row each
_NUMBER = re.compile(r"(\d+)\D*$")


@dataclass(frozen=True, eq=False)
class ImageSeries:
    """Images of a camera.

    name: for messages; numbers: of the images there are, rising, (n,); load: the image of a number, grey values (height,
    width) as float32 from 0 to 255, or None where it cannot be read; size: (width, height); numbered: whether the
    numbers are those of files, not of a place in a row.
    """

    name: str
    numbers: tuple[int, ...]
    load: Callable[[int], Array | None]
    size: tuple[int, int]
    numbered: bool = False


def image_series(images: Any, name: str) -> ImageSeries:
    """The images of a folder or an array; ModelError for what is neither, has none, or images of several sizes."""
    if isinstance(images, (str, os.PathLike)):
        return _of_folder(Path(images))
    if isinstance(images, Sequence) and all(isinstance(image, np.ndarray) for image in images):
        return _of_arrays(list(images), name)
    if isinstance(images, np.ndarray):
        colour = images.ndim == 3 and images.shape[-1] in (3, 4) and images.shape[1] > 4
        return _of_arrays([images] if images.ndim == 2 or colour else list(images), name)
    raise ModelError(
        f"detect: {name}: found {type(images).__name__}, expected a folder of images or an array (N, height, width)"
    )


def rows_of(cameras: Sequence[ImageSeries]) -> tuple[int, ...]:
    """The numbers of images over all cameras, one for each row: also those that all cameras lack between others.

    Files are paired by the last number in their names. ModelError where images without one differ in number.
    """
    counts = [len(series.numbers) for series in cameras]
    if len(set(counts)) > 1 and not all(series.numbered for series in cameras):
        raise ModelError(
            f"detect: found {' and '.join(map(str, counts))} images, expected as many of each camera, pose by pose; folders "
            "whose files have numbers in their names may lack some"
        )
    numbers = sorted({number for series in cameras for number in series.numbers})
    gaps = np.diff(numbers)
    stride = int(np.gcd.reduce(gaps)) if len(gaps) else 1
    every = range(numbers[0], numbers[-1] + 1, max(stride, 1))
    return tuple(every) if len(every) <= SPARSE * len(numbers) else tuple(numbers)


def _of_folder(folder: Path) -> ImageSeries:
    if not folder.is_dir():
        raise ModelError(f"{folder}: there is no such folder; check its path")
    files = sorted(file for file in folder.iterdir() if file.suffix.lower() in ENDINGS)
    if not files:
        raise ModelError(f"{folder}: found no images, expected files ending in {', '.join(ENDINGS)}")
    found = [_NUMBER.search(file.stem) for file in files]
    numbers = [int(match[1]) if match else k for k, match in enumerate(found)]
    if any(found) and not all(found):
        bare = next(file for file, match in zip(files, found, strict=True) if not match)
        raise ModelError(f"{bare}: found no number in its name, others have one; rename it or move it away")
    paths: dict[int, Path] = {}
    for file, number in zip(files, numbers, strict=True):
        if number in paths:
            raise ModelError(
                f"{file}: has the number {number}, as {paths[number].name}; images of cameras are paired by the "
                "last number in their names, rename one"
            )
        paths[number] = file
    size: list[tuple[int, int]] = []

    def load(number: int) -> Array | None:
        path = paths.get(number)
        image = None if path is None else read_image(path)
        return None if image is None else _of_size(image, size, str(path))

    first = next((image for number in sorted(paths) if (image := load(number)) is not None), None)
    if first is None:
        raise ModelError(f"{folder}: none of {len(files)} images can be read; write them anew")
    return ImageSeries(str(folder), tuple(sorted(paths)), load, size[0], all(found))


def _of_arrays(images: list[Array], name: str) -> ImageSeries:
    if not images:
        raise ModelError(f"detect: {name}: found no images, expected an array (N, height, width)")
    size: list[tuple[int, int]] = []

    def load(k: int) -> Array | None:
        return _of_size(images[k], size, f"detect: {name}, image {k}") if k < len(images) else None

    load(0)
    return ImageSeries(name, tuple(range(len(images))), load, size[0])


def _of_size(image: Array, size: list[tuple[int, int]], place: str) -> Array:
    """Grey values of an image that has the size of those before it."""
    values = grey_of(image, place)
    found = (values.shape[1], values.shape[0])
    if size and size[0] != found:
        raise ModelError(
            f"{place}: found {found[0]} x {found[1]} pixels, expected {size[0][0]} x {size[0][1]} as of the images before; "
            "one camera has one size"
        )
    size[:] = [found]
    return values


def grey_of(image: Array, place: str) -> Array:
    """Grey values from 0 to 255, float32, of an image of 8 or 16 bits, grey or blue, green, red and perhaps opacity."""
    if image.dtype not in SCALE:
        raise ModelError(
            f"{place}: found numbers of type {image.dtype}, expected images of 8 or 16 bits, uint8 or uint16"
        )
    if image.ndim == 3 and image.shape[2] in (3, 4):
        values = image[..., :3].astype(np.float32) @ LIGHTNESS
    elif image.ndim == 2 or (image.ndim == 3 and image.shape[2] == 1):
        values = image.reshape(image.shape[:2]).astype(np.float32)
    else:
        raise ModelError(
            f"{place}: found an image of shape {image.shape}, expected (height, width) or (height, width, 3)"
        )
    height, width = image.shape[:2]
    if min(height, width) < 16:
        raise ModelError(f"{place}: found {width} x {height} pixels, expected at least 16 x 16")
    return values * np.float32(SCALE[image.dtype])
