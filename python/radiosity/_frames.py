"""Lists of frames as text in TOML."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any, Union

from ._arguments import path as path_of, toml
from ._errors import ArgumentError

#: A TOML file, or its frames as dicts.
Frames = Union[str, "os.PathLike[str]", Sequence[Mapping[str, Any]]]


def frames_text(frames: Frames) -> tuple[str, str]:
    """Returns a list of frames as text in TOML with a name for messages, or no text and the name of its file."""
    if isinstance(frames, (str, os.PathLike)):
        return "", path_of("frames", frames)
    if not hasattr(frames, "__iter__"):
        raise ArgumentError(f"frames: {type(frames).__name__}, expected a path or dicts")
    lines: list[str] = []
    for k, frame in enumerate(frames):
        if not isinstance(frame, Mapping):
            raise ArgumentError(f"frames[{k}]: expected a dict, found {type(frame).__name__}")
        lines.append("[[frame]]")
        lines += [f"{key} = {toml(f'frames[{k}][{key!r}]', value)}" for key, value in frame.items()]
    # Paths are relative to the working directory: the name has no folder.
    return "\n".join(lines) + "\n", "frames"
