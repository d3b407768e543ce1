"""Form factors with their errors and checks."""

from __future__ import annotations

import json
import os
from functools import cached_property
from typing import TYPE_CHECKING, Any, Optional, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from ._arguments import floats, path as path_of
from ._errors import ArgumentError
from ._result import Result

if TYPE_CHECKING:
    from ._model import Model

Floats = NDArray[np.float64]

#: From this share of entries that are not zero on, `matrix` is an array of NumPy.
DENSE_FROM = 1.0 / 3.0


class FormFactors(Result[_core.FormFactors]):
    """Form factors (view factors) between the n patches of a model, with the error of each.

    A row is from i to j: F[i, j] is the fraction of the light leaving patch i that reaches patch j. In a closed
    scene each row sums to 1. Reciprocity holds: A_i F_ij = A_j F_ji. `Model.form_factors` and `load` make
    them.

    Notes
    -----
    The errors of sums over many entries are smaller than the sum of the entries' errors: `surface_error` estimates those of
    `surface`. The methods, with their sources and the measured coverage of the stated errors, are in
    `docs/methods.md` and `docs/stated-errors.md` of the project.
    """

    def __init__(self, core: _core.FormFactors, model: Model) -> None:
        super().__init__(core)
        self._model = model

    def __repr__(self) -> str:
        n = self._model.n_patches
        return f"<FormFactors {n} x {n}, row i to column j>"

    @property
    def model(self) -> Model:
        """The model of the form factors."""
        return self._model

    @property
    def shape(self) -> tuple[int, int]:
        """The shape (n, n)."""
        return self._model.n_patches, self._model.n_patches

    @cached_property
    def _rows(self) -> tuple[Floats, Floats, NDArray[np.int64], NDArray[np.int64]]:
        return self._core.rows()

    @cached_property
    def _surface(self) -> tuple[Floats, Floats, Floats]:
        return self._core.surface()

    @property
    def surface(self) -> Floats:
        """Form factors between surfaces, (s, s): row i, column j is from surface i to surface j, area-weighted over patches."""
        return self._surface[0]

    @property
    def surface_error(self) -> Floats:
        """Estimates of the absolute errors of `surface`, (s, s), from surface i to surface j; NaN where unknown."""
        return self._surface[1] if self.errors_known else np.full_like(self._surface[1], np.nan)

    @property
    def lost(self) -> Floats:
        """The fraction 1 - sum_j F_ij of the light of each surface that no front of a face receives, (s,)."""
        return self._surface[2]

    @property
    def sky(self) -> Floats:
        """The fraction of the light of each patch that escapes from the scene, (n,): the sky view factor."""
        return self._core.sky(False)[0]

    @property
    def sky_error(self) -> Floats:
        """Estimates of the absolute errors of `sky`, (n,)."""
        return self._core.sky(False)[1]

    @property
    def surface_sky(self) -> Floats:
        """The area mean of `sky` over each surface, (s,)."""
        return self._core.sky(True)[0]

    @property
    def surface_sky_error(self) -> Floats:
        """Estimates of the absolute errors of `surface_sky`, (s,)."""
        return self._core.sky(True)[1]

    @property
    def backs(self) -> Floats:
        """The fraction of the light of each patch that black backs of faces absorb, (n,)."""
        return self._core.sky(False)[2]

    @property
    def backs_error(self) -> Floats:
        """Estimates of the absolute errors of `backs`, (n,)."""
        return self._core.sky(False)[3]

    @cached_property
    def row_sums(self) -> Floats:
        """The row sum sum_j F_ij of each patch i, (n,): 1 in a closed scene, else 1 - `sky` - `backs`."""
        return self._core.row_sums()

    @property
    def row_sum_errors(self) -> Floats:
        """Estimates of the absolute errors of `row_sums`, (n,); NaN where unknown.

        They are the sums of the stated errors of a row's entries, which may have one sign, and the noise.
        """
        errors = self._core.sky(False)[4]
        return errors if self.errors_known else np.full_like(errors, np.nan)

    @property
    def errors_known(self) -> bool:
        """False for form factors from a file without errors."""
        return self._core.errors_known

    @property
    def is_symmetric(self) -> bool:
        """True if A_i F_ij is symmetric to rounding, so that `aslinearoperator` has a transpose."""
        return self._core.is_symmetric

    @property
    def density(self) -> float:
        """The share of entries that are not zero."""
        return self._core.density

    @property
    def matrix(self) -> Any:
        """F, (n, n): row i, column j is from patch i to patch j.

        A `scipy.sparse.csr_array` if SciPy is installed and fewer than a third of the entries are not
        zero, else an array of NumPy. `toarray` and `tocsr` give one or the other always.
        """
        return self.tocsr() if self._is_sparse else self.toarray()

    @property
    def errors(self) -> Any:
        """Estimates of the absolute error of each entry of `matrix`, (n, n), from patch i to patch j, of the same kind of array.

        An array of NumPy also holds the errors of entries that no ray hit; a sparse one those of the
        entries of `matrix`. Rounded to float32 where they are stored; NaN where unknown.
        """
        if not self.errors_known:
            return np.full(self.shape, np.nan)
        if not self._is_sparse:
            return self._core.full(True)
        _, errors, columns, ends = self._rows
        return _csr_array()((errors, columns, ends), shape=self.shape)

    @property
    def _is_sparse(self) -> bool:
        if self.density >= DENSE_FROM:
            return False
        try:
            _csr_array()
        except ImportError:
            return False
        return True

    def toarray(self) -> Floats:
        """Returns F as an array of NumPy, (n, n), from patch i to patch j: 8 n^2 bytes."""
        return self._core.full(False)

    def tocsr(self) -> Any:
        """Returns F as a `scipy.sparse.csr_array`, (n, n), from patch i to patch j."""
        values, _, columns, ends = self._rows
        return _csr_array()((values, columns, ends), shape=self.shape)

    def __matmul__(self, x: ArrayLike) -> Floats:
        """Returns F x: (F x)_i = sum_j F_ij x_j, from patch i to patch j; the irradiance of radiosities.

        Parameters
        ----------
        x : array_like, (n,) or (n, k)
            Numbers of each patch, k columns in one pass over F.

        Returns
        -------
        ndarray, of the shape of `x`
            Sums are float64, in an order that does not depend on the number of threads.
        """
        return self._applied(x, transposed=False)

    def _applied(self, x: ArrayLike, transposed: bool) -> Floats:
        array = floats("x", x)
        n = self.shape[0]
        if array.ndim not in (1, 2) or array.shape[0] != n:
            raise ArgumentError(f"x: shape {array.shape}, expected ({n},) or ({n}, k)")
        if array.size == 0:
            return np.zeros(array.shape)
        columns = np.ascontiguousarray(array.reshape(n, -1))
        shape: tuple[int, ...] = array.shape
        return self._core.apply(columns, transposed).reshape(shape)

    def aslinearoperator(self) -> Any:
        """Returns F as a `scipy.sparse.linalg.LinearOperator`, (n, n), from patch i to patch j.

        It has a transpose if `is_symmetric`: F^T = A F A^-1.
        """
        from scipy.sparse.linalg import LinearOperator

        def apply(x: Floats) -> Floats:
            return self._applied(x, transposed=False)

        def transposed(x: Floats) -> Floats:
            return self._applied(x, transposed=True)

        back = transposed if self.is_symmetric else None
        return LinearOperator(
            shape=self.shape, dtype=np.float64, matvec=apply, matmat=apply, rmatvec=back, rmatmat=back
        )

    @cached_property
    def checks(self) -> dict[str, Any]:
        """Row sums, reciprocity, rays and storage, by the names of `radiosity form-factors --json`."""
        found: dict[str, Any] = json.loads(self._core.record)
        return found

    @property
    def settings(self) -> dict[str, Any]:
        """The settings of their computation, by their names in files."""
        found: dict[str, Any] = json.loads(self._core.settings)
        return found

    def save(
        self, path: Union[str, os.PathLike[str]], *, dense: bool = False, surface: Optional[str] = None
    ) -> None:
        """Writes the form factors, a row from i to j, in the format of the ending of `path`.

        Parameters
        ----------
        path : path
            ``.npz`` (`scipy.sparse.load_npz` reads it; `load` too), ``.npy``, ``.mtx`` or ``.exr`` between
            patches, ``.csv`` or View3D's ``.vf`` between surfaces, ``.vtu`` of each patch, ``.ply`` or
            ``.obj`` of patches in colours.
        dense : bool
            Write F and its errors in full, with ``.npz``.
        surface : str, optional
            With ``.vtu``, ``.ply`` and ``.obj``: the form factor from each patch to this surface is written.

        Raises
        ------
        FileError
            If the file cannot be written.
        """
        self._core.save(path_of("path", path), dense, surface)


def _csr_array() -> Any:
    from scipy.sparse import csr_array

    return csr_array
