"""What the commands of `gantrytau vision` share: how messages of the library are spelt."""

from gantrytau.commands.printing.spelling import Spelling

SPELLING = Spelling(
    ("detect", "reconstruct", "compare", "Pattern", "Camera"),
    {"background": "--background", "side": "--side", "spacing": "--carts", "scale": "--scale"}
    | {"orientation": "--turning", "intrinsics": "--estimate", "corners": "--free"},
    exactly={
        "intrinsics='estimate' finds them": "--estimate finds them",
        "intrinsics='fixed'": "no --estimate",
        "orientation='free' lets them": "--turning lets them",
        "scale='both'": "--scale both",
        "scale='pattern'": "--scale pattern",
        "corners='plate'": "no --free",
    },
)
