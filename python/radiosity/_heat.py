"""Temperatures and net fluxes, exchange factors, and the views of free points."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Optional, Union

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._arguments import path, toml
from ._errors import ArgumentError
from ._result import Result

if TYPE_CHECKING:
    from ._factors import FormFactors
    from ._model import Model

Floats = NDArray[np.float64]

#: A TOML file, or the same as a dict; values of surfaces may be arrays over patches.
Boundary = Union[str, "os.PathLike[str]", Mapping[str, Any]]


def boundary_parts(boundary: Boundary) -> tuple[Optional[list[tuple[str, str]]], str]:
    """Returns the entries of boundary conditions, each with its name in messages and its text in TOML, or none and the name of their file."""
    if not isinstance(boundary, Mapping):
        return None, path("boundary", boundary)
    parts: list[tuple[str, str]] = []
    for key, value in boundary.items():
        if key in ("surface", "node"):
            parts += [(name, _text(f"[[{key}]]", name, entry)) for name, entry in _entries(key, value)]
        elif isinstance(value, Mapping):
            name = f"boundary[{key!r}]"
            parts.append((name, _text(f"[{json.dumps(str(key))}]", name, value)))
        else:
            raise ArgumentError(f"boundary[{key!r}]: expected a dict, found {type(value).__name__}")
    return parts, "boundary"


def _entries(key: str, value: Any) -> list[tuple[str, Mapping[str, Any]]]:
    """Returns entries with their names in messages, from a list of them or from a dict by their own names."""
    where = f"boundary[{key!r}]"
    if isinstance(value, Mapping) and all(isinstance(entry, Mapping) for entry in value.values()):
        return [(f"{where}[{name!r}]", {"name": name, **entry}) for name, entry in value.items()]
    if isinstance(value, Sequence) and all(isinstance(entry, Mapping) for entry in value):
        return [(f"{where}[{k}]", entry) for k, entry in enumerate(value)]
    raise ArgumentError(f"{where}: expected a list of dicts, or a dict of dicts by names")


def _text(head: str, where: str, table: Mapping[str, Any]) -> str:
    """Returns a table as TOML."""
    rows = [f"{json.dumps(str(key))} = {toml(f'{where}[{key!r}]', value)}" for key, value in table.items()]
    return "\n".join([head, *rows, ""])


class Heat(Result[_core.Heat], Mapping[str, Floats]):
    """Temperatures, fluxes and their errors, of each patch, each surface and the scene.

    `Model.heat` makes it. As a mapping it holds the quantities of the n patches by name, the unit in the
    name: ``temperature_k``, ``net_flux_w_m2``, ``supplied_w_m2``, ``irradiance_w_m2``, ``radiosity_w_m2``,
    ``solar_irradiance_w_m2`` and others; ``NAME_error`` estimates the absolute error of ``NAME``, infinite
    where unknown. The equations are in `docs/heat.md` of the project. `save` writes a row for each
    patch as ``.csv``, ``.npz``, ``.vtu``, or ``.ply`` or ``.obj`` in colours.
    """

    def __init__(self, core: _core.Heat, factors: FormFactors) -> None:
        super().__init__(core)
        self._factors = factors
        self._patches = dict(core.patches())

    def __repr__(self) -> str:
        return f"<Heat of {len(self.surfaces)} surfaces>"

    def __getitem__(self, name: str) -> Floats:
        return self._patches[name]

    def __iter__(self) -> Any:
        return iter(self._patches)

    def __len__(self) -> int:
        return len(self._patches)

    @property
    def temperature(self) -> Floats:
        """The temperature T of each patch, K, (n,)."""
        return self["temperature_k"]

    @property
    def temperature_error(self) -> Floats:
        """Estimates of the absolute errors of `temperature`, K, (n,)."""
        return self["temperature_k_error"]

    @property
    def net_flux(self) -> Floats:
        """The net flux q = B - H of the thermal band, leaving each patch, W/m2, (n,)."""
        return self["net_flux_w_m2"]

    @property
    def net_flux_error(self) -> Floats:
        """Estimates of the absolute errors of `net_flux`, W/m2, (n,)."""
        return self["net_flux_w_m2_error"]

    @cached_property
    def _record(self) -> dict[str, Any]:
        found: dict[str, Any] = json.loads(self._core.record)
        return found

    @property
    def surfaces(self) -> list[dict[str, Any]]:
        """The heat of each surface, by the names of `radiosity heat --json`: ``temperature_k``, ``net_heat_w``, ..."""
        found: list[dict[str, Any]] = self._record["surfaces"]
        return found

    @property
    def balance(self) -> dict[str, float]:
        """The heat balance of the scene, W, with errors: ``supplied_w``, ``escaped_w``, ``energy_balance_w``, ..."""
        return {name: value for name, value in self._record.items() if name.removesuffix("_error").endswith("_w")}

    @property
    def relative_error(self) -> Optional[float]:
        """The greatest error of a surface's irradiance, relative to the larger of that and its emissive power."""
        error: Optional[float] = self._record["relative_error_max"]
        return error

    @property
    def mesh_error(self) -> Optional[dict[str, Any]]:
        """The change by a mesh of about a quarter of the patches in the thermal band; None where unknown."""
        found: Optional[dict[str, Any]] = self._record["mesh_error"]
        return found


@dataclass(frozen=True)
class ExchangeFactors:
    """Exchange factors between the m nodes of a thermal network, the last of which is the surroundings.

    A row is from i to j.

    Attributes
    ----------
    names : list of str
        The nodes: surfaces or patches, and ``surroundings``.
    emissivity : ndarray, (m,)
        Area means.
    gebhart : ndarray, (m, m)
        G[i, j]: the fraction of the emission of node i that node j absorbs, reflections included; rows sum to 1.
    gebhart_error : ndarray, (m, m)
        Estimates of their absolute errors.
    conductance : ndarray, (m, m)
        A_i e_i G_ij, m2, symmetric: the heat from i to j is sigma (T_i^4 - T_j^4) times it.
    """

    names: list[str]
    emissivity: Floats
    gebhart: Floats
    gebhart_error: Floats
    conductance: Floats

    @property
    def script_f(self) -> Floats:
        """The factors script-F, e_i G_ij, (m, m), from i to j."""
        return self.emissivity[:, np.newaxis] * self.gebhart


class PointViews(Mapping[str, Floats]):
    """The views from k free points, and the irradiances there.

    `Model.points` makes it. The factors of a point sum to 1. As a mapping it holds ``surroundings`` and
    ``backs``, and for points in a scene with heat ``irradiance``, ``solar``, ``sun`` (W/m2), ``sunlit`` and
    ``mean_radiant_temperature`` (K), (k,) each; ``NAME_error`` estimates the absolute error of ``NAME``.
    NaN where undefined.
    """

    def __init__(
        self,
        model: Model,
        found: tuple[Floats, Floats, list[str], list[tuple[str, Floats]]],
    ) -> None:
        self._model = model
        self._factors, self._errors, self._status, columns = found
        self._columns = dict(columns)

    def __repr__(self) -> str:
        return f"<PointViews of {len(self._status)} points>"

    def __getitem__(self, name: str) -> Floats:
        return self._columns[name]

    def __iter__(self) -> Any:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)

    @property
    def factors(self) -> Floats:
        """The factor from each point to the front of each surface, (k, s): of a point with a normal the form factor, else the share of the sphere."""
        return self._factors

    @property
    def factor_errors(self) -> Floats:
        """Estimates of the absolute errors of `factors`, (k, s), from point to surface."""
        return self._errors

    @property
    def status(self) -> list[str]:
        """``free``, ``on_face`` or ``inside_solid`` of each point; results for the latter two are hardly meaningful."""
        return self._status

    @property
    def irradiance(self) -> Floats:
        """The thermal irradiance, W/m2, (k,); for points without a normal the mean radiosity around."""
        return self["irradiance"]

    @property
    def mean_radiant_temperature(self) -> Floats:
        """The mean radiant temperature, K, (k,), of points without a normal: (sum F B / sigma)^(1/4)."""
        return self["mean_radiant_temperature"]


class SunPath(Mapping[str, Floats]):
    """Light or heat at k times of the sun.

    `Model.along_sun_path` makes it. As a mapping it holds the quantities of the n patches by name, those
    that change with a first axis for the times, (k, n, c) for light and (k, n) for heat; the names are those
    of `Solution` (``radiosity``, ``irradiance``, ``error``, ``sunlit_fraction``, ...) and of `Heat`.
    """

    def __init__(self, times: Floats, texts: Sequence[str], document: str, arrays: list[tuple[str, Floats]]) -> None:
        self._arrays = dict(arrays)
        #: The times, (k,): numbers as they were given, or s from the first date.
        self.times = times
        #: The times as they were written.
        self.time_texts = list(texts)
        #: What the program prints with ``--json``: ``steps`` has the surfaces of each time.
        self.document: dict[str, Any] = json.loads(document)

    def __getitem__(self, name: str) -> Floats:
        return self._arrays[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._arrays)

    def __len__(self) -> int:
        return len(self._arrays)

    def __repr__(self) -> str:
        return f"SunPath({len(self.times)} times of {', '.join(self._arrays)})"
