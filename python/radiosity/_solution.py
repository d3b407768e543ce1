"""Solutions of the radiosity system."""

from __future__ import annotations

import json
from functools import cached_property
from typing import TYPE_CHECKING, Any, Optional

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._result import Result

if TYPE_CHECKING:
    from ._factors import FormFactors
    from ._model import Model

Floats = NDArray[np.float64]


class Solution(Result[_core.Solution]):
    """Radiosities of the n patches of a model, B = E + rho F B, with their errors.

    `Model.solve` makes them. F is from patch i to patch j. Arrays over patches have the shape (n,) for a
    gray scene, (n, 3) for one with colours, or that of the exitance given to `Model.solve`. `save` writes
    ``.csv``, ``.npz``, ``.vtu``, or ``.ply`` or ``.obj`` in colours.
    """

    def __init__(
        self, core: _core.Solution, model: Model, factors: FormFactors, shape: Optional[tuple[int, ...]]
    ) -> None:
        super().__init__(core)
        self._model = model
        self._factors = factors
        n, n_channels = core.radiosity.shape
        self._shape: tuple[int, ...] = shape or ((n,) if n_channels == 1 else (n, n_channels))

    def __repr__(self) -> str:
        return f"<Solution {self._shape}, {self.stop_reason} after {self.n_passes} passes>"

    @property
    def model(self) -> Model:
        """The model of the solution."""
        return self._model

    @property
    def form_factors(self) -> FormFactors:
        """The form factors of the solution, from patch i to patch j."""
        return self._factors

    @property
    def radiosity(self) -> Floats:
        """The radiosity B of each patch, W/m2."""
        return self._core.radiosity.reshape(self._shape)

    @property
    def irradiance(self) -> Floats:
        """The irradiance H of each patch, W/m2: F B, and the direct light of sun and sky."""
        return self._core.irradiance.reshape(self._shape)

    @property
    def reflectance(self) -> Floats:
        """The reflectance rho of each patch."""
        return self._core.reflectance.reshape(self._shape)

    @property
    def exitance(self) -> Floats:
        """The exitance E of each patch, W/m2."""
        return self._core.exitance.reshape(self._shape)

    @property
    def error(self) -> Optional[Floats]:
        """Estimates of the absolute error of `radiosity` by the errors of the form factors, W/m2; None where unknown.

        The solver's error is in `error_bound`, that of the mesh in `mesh_error`.
        """
        error = self._core.error
        return None if error is None else error.reshape(self._shape)

    @cached_property
    def _record(self) -> dict[str, Any]:
        found: dict[str, Any] = json.loads(self._core.record)
        return found

    @property
    def error_bound(self) -> Optional[float]:
        """A proven bound on the relative error of B by the solver, in the area-weighted L2 norm, the worst channel; None where none is known."""
        bound: Optional[float] = self._record["error_bound"]
        return bound

    @property
    def relative_error(self) -> Optional[float]:
        """An estimate of the relative error of B by solver and form factors, in the same norm, without that of the mesh."""
        error: Optional[float] = self._record["estimated_relative_error"]
        return error

    @cached_property
    def mesh_error(self) -> Optional[dict[str, Any]]:
        """The change by a mesh of about a quarter of the patches; None where unknown."""
        found: Optional[dict[str, Any]] = json.loads(self._core.mesh_error)
        return found

    @property
    def surface_means(self) -> Floats:
        """The area mean of B over each surface, W/m2: (s,), (s, 3) or (s, k)."""
        means = self._core.surface_means()
        return means.reshape(len(means), *self._shape[1:])

    @property
    def solver(self) -> str:
        """The solver; with ``auto`` the chosen one."""
        name: str = self._record["solver"]
        return name

    @property
    def stop_reason(self) -> str:
        """The stop reason: ``converged``, ``max_passes``, ``stagnated`` or ``diverged``."""
        reason: str = self._record["stop_reason"]
        return reason

    @property
    def n_passes(self) -> int:
        """The number of passes over the form factors."""
        count: int = self._record["n_passes"]
        return count

    @property
    def residual(self) -> Optional[float]:
        """The residual sqrt(sum A r^2 / sum A E^2), the worst channel, with r = E - (I - diag(rho) F) B."""
        value: Optional[float] = self._record["residual_l2"]
        return value

    @property
    def history(self) -> list[dict[str, Any]]:
        """The state after each pass: `pass`, `time_s`, `residual_l2`, `residual_max_power` and more."""
        entries: list[dict[str, Any]] = self._record["history"]
        return entries

    @cached_property
    def energy(self) -> list[dict[str, Any]]:
        """The power balance of each channel, W."""
        flows: list[dict[str, Any]] = json.loads(self._core.energy)
        return flows

    @property
    def sunlit(self) -> Optional[dict[str, Floats]]:
        """`fraction` of each patch that the sun lights and `irradiance` straight from it, W/m2, with `fraction_error` and `irradiance_error`; None without a sun."""
        found = self._core.sunlit()
        if found is None:
            return None
        fraction, fraction_error, irradiance, error = found
        return {
            "fraction": fraction,
            "fraction_error": fraction_error,
            "irradiance": irradiance.reshape(self._shape),
            "irradiance_error": error.reshape(self._shape),
        }
