"""A scene with its patches, and the computations on it."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, Optional, TypedDict, Union, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from ._arguments import Values, faces as face_array, flag, floats, given, instance, of_faces, of_patches, optional_path
from ._arguments import path as path_of, points as point_array, squeezed, surfaces as surface_array, table, turned, vector, whole
from ._errors import ArgumentError
from ._factors import FormFactors
from ._frames import Frames, frames_text
from ._heat import Boundary, ExchangeFactors, Heat, PointViews, SunPath, boundary_parts
from ._image import Image
from ._progress import Bar, Progress
from ._solution import Solution
from ._voxels import VoxelSolution

Floats = NDArray[np.float64]
Path = Union[str, "os.PathLike[str]"]

#: The sun: `irradiance` of a plane that faces it, W/m2 (a number, or three channels), with `direction` (towards
#: it, of any length), or `latitude`, `longitude` (degrees), `time` (RFC 3339) and `north`; `angular_radius` in degrees.
Sun = Mapping[str, Any]


class Settings(TypedDict, total=False):
    """The keyword arguments of `Model`."""

    surfaces: Optional[Sequence[Any]]
    reflectance: Values
    exitance: Values
    subdivide: Optional[int]
    max_edge: Optional[float]
    cut_at_walls: bool
    crease_angle: Optional[float]
    merge_tolerance: Optional[float]
    unit: Optional[str]
    up_axis: Optional[str]
    flip: Union[bool, str, Sequence[str]]
    progress: Progress


class Model:
    """A scene of flat faces, cut into n patches, ready for form factors.

    A face sees on the side of its winding's normal (counter-clockwise seen from the front) and occludes
    on both sides; its back is black. Two coincident faces of opposite winding are a two-sided sheet.

    Parameters
    ----------
    vertices : array_like, (v, 3)
        Positions. Bit-identical ones are one vertex.
    faces : array_like, (m, 3), (m, 4), or a list of lists
        Indices into `vertices`, counter-clockwise seen from the front. Bent or concave quads and larger
        polygons become triangles.
    surfaces : sequence of str or int, (m,), optional
        The surface of each face; ``N`` stands for ``surfaceN``. Surfaces are in the order in which they
        appear. Without it they are connected pieces between creases, ``faceN`` and ``partN`` with the
        number of their first face, counted from 1.
    reflectance : float, array_like or dict
        rho, in [0, 1]: a number, (1, 3) for one colour, (m,) or (m, 3) of each face, or a dict from names
        of surfaces to numbers or triples, with ``"*"`` for all others.
    exitance : float, array_like or dict
        E, W/m2, as `reflectance`.
    subdivide : int, optional
        Cut every edge into this many parts: a quad into n x n patches, a triangle into n^2. Default 1.
    max_edge : float, optional
        Cut every edge into parts of at most this length, m, instead.
    cut_at_walls : bool
        Cut faces where others stand on them or pierce them (contact edges); without it light leaks there.
    crease_angle : float, optional
        The angle, degrees, beyond which two faces at an edge are different surfaces, without `surfaces`. Default 40.
    merge_tolerance : float, optional
        Join vertices up to this distance, m; the movement counts as rounding. Default 0.
    unit : {"m", "mm", "cm", "in", "ft"}, optional
        The unit of `vertices`. Default m.
    up_axis : {"y", "z"}, optional
        The axis that points upwards; "y" turns (x, y, z) into (x, -z, y). Default "z".
    flip : bool, str or sequence of str
        Reverse the winding of all faces, or of those of a surface or of several.
    progress : bool or callable, optional
        A bar, none, or a function ``f(stage, done, total)``. By default a bar in a terminal or notebook.

    Raises
    ------
    ArgumentError
        If an argument has a wrong shape or is not finite; the message names it.
    SceneError
        If a scene cannot have these faces; the message names the face or vertex.
    """

    def __init__(
        self,
        vertices: ArrayLike,
        faces: Any,
        *,
        surfaces: Optional[Sequence[Any]] = None,
        reflectance: Values = 0.5,
        exitance: Values = 0.0,
        subdivide: Optional[int] = None,
        max_edge: Optional[float] = None,
        cut_at_walls: bool = True,
        crease_angle: Optional[float] = None,
        merge_tolerance: Optional[float] = None,
        unit: Optional[str] = None,
        up_axis: Optional[str] = None,
        flip: Union[bool, str, Sequence[str]] = False,
        progress: Progress = None,
    ) -> None:
        positions = point_array("vertices", vertices)
        corners, ends = face_array(faces, len(positions))
        names, of_face = surface_array(surfaces, len(ends))
        rho = of_faces("reflectance", reflectance, names, of_face, len(ends))
        e = of_faces("exitance", exitance, names, of_face, len(ends))
        for name, values, limit in (("reflectance", rho, 1.0), ("exitance", e, np.inf)):
            wrong = np.argwhere((values < 0.0) | (values > limit))
            if len(wrong):
                at = f" of face {wrong[0][0]}" if len(values) > 1 else ""
                raise ArgumentError(f"{name}: {values[tuple(wrong[0])]}{at} is outside [0, {limit}]")
        options = given(
            subdivide=subdivide,
            max_edge=max_edge,
            cut_at_walls=cut_at_walls,
            crease_angle=crease_angle,
            merge_tolerance=merge_tolerance,
            unit=unit,
            up_axis=up_axis,
            flip=turned(flip),
        )
        with Bar(progress) as callback:
            self._core = _core.Model.from_arrays(positions, corners, ends, names, of_face, rho, e, options, callback)

    @classmethod
    def read(
        cls,
        path: Path,
        *,
        format: Optional[str] = None,
        subdivide: Optional[int] = None,
        max_edge: Optional[float] = None,
        cut_at_walls: bool = True,
        materials: Optional[Path] = None,
        surface_array: Optional[str] = None,
        one_surface: bool = False,
        crease_angle: Optional[float] = None,
        merge_tolerance: Optional[float] = None,
        unit: Optional[str] = None,
        up_axis: Optional[str] = None,
        flip: Union[bool, str, Sequence[str]] = False,
        allow_outside: bool = False,
        progress: Progress = None,
    ) -> Model:
        """Reads a scene file: OBJ, STL, PLY, gmsh, VTK, glTF or View3D input.

        Parameters
        ----------
        path : path
            The file. Its format is found by its content and then by its suffix.
        format : {"obj", "stl", "ply", "msh", "vtk", "gltf", "vs3"}, optional
            The format, in place of detection.
        materials : path, optional
            A TOML file of reflectances and exitances by surface or material.
        surface_array : str, optional
            The cell array of a VTK or PLY file whose values are the surfaces.
        one_surface : bool
            Make one surface of all faces.
        allow_outside : bool
            Read material libraries and buffers that lie outside the scene's folder.
        subdivide, max_edge, cut_at_walls, crease_angle, merge_tolerance, unit, up_axis, flip, progress
            As of `Model`.

        Returns
        -------
        Model

        Raises
        ------
        SceneError
            If the file cannot be read, with file, line or element.
        """
        options = given(
            format=format,
            subdivide=subdivide,
            max_edge=max_edge,
            cut_at_walls=cut_at_walls,
            materials=optional_path("materials", materials),
            surface_array=surface_array,
            one_surface=one_surface,
            crease_angle=crease_angle,
            merge_tolerance=merge_tolerance,
            unit=unit,
            up_axis=up_axis,
            flip=turned(flip),
            allow_outside=allow_outside,
        )
        model = cls.__new__(cls)
        with Bar(progress) as callback:
            model._core = _core.Model.read(path_of("path", path), options, callback)
        return model

    @classmethod
    def builtin(
        cls,
        name: str,
        *,
        level: Optional[int] = None,
        subdivide: Optional[int] = None,
        max_edge: Optional[float] = None,
        cut_at_walls: bool = True,
        progress: Progress = None,
    ) -> Model:
        """Makes a built-in scene.

        Parameters
        ----------
        name : str
            Such as ``cube``, ``cornell-box``, ``lewis-room``, ``room-box``; the message of another name lists all.
        level : int, optional
            The level of refinement, for scenes that have levels.
        subdivide, max_edge, cut_at_walls, progress
            As of `Model`.

        Returns
        -------
        Model

        Raises
        ------
        SceneError
            If there is no such scene or level.
        """
        options = given(subdivide=subdivide, max_edge=max_edge, cut_at_walls=cut_at_walls)
        depth = None if level is None else whole("level", level, 0)
        model = cls.__new__(cls)
        with Bar(progress) as callback:
            model._core = _core.Model.builtin(instance("name", name, str), depth, options, callback)
        return model

    def __repr__(self) -> str:
        return f"<Model: {self.n_patches} patches on {len(self.surfaces)} surfaces>"

    @cached_property
    def n_patches(self) -> int:
        """The number of patches n."""
        return self._core.n_patches

    @cached_property
    def surfaces(self) -> list[str]:
        """The names of the s surfaces, in the order of their ids."""
        return self._core.surface_names

    @property
    def surface_area(self) -> Floats:
        """The area of each surface, m2, (s,)."""
        return self._core.surface_area

    @cached_property
    def patch_surface(self) -> NDArray[np.int64]:
        """The id of the surface of each patch, an index into `surfaces`, (n,)."""
        return self._core.patch_surface

    @cached_property
    def patch_area(self) -> Floats:
        """The area of each patch, m2, (n,)."""
        return self._core.patch_area

    @property
    def patch_centroid(self) -> Floats:
        """The centroid of each patch, m, (n, 3)."""
        return self._core.patch_frame[0]

    @property
    def patch_normal(self) -> Floats:
        """The unit normal of each patch, on its front, (n, 3)."""
        return self._core.patch_frame[1]

    @property
    def reflectance(self) -> Floats:
        """The reflectance rho of each patch, (n,) for a gray scene, else (n, 3)."""
        return squeezed(self._core.materials()[0])

    @property
    def exitance(self) -> Floats:
        """The exitance E of each patch, W/m2, (n,) for a gray scene, else (n, 3)."""
        return squeezed(self._core.materials()[1])

    def form_factors(
        self,
        method: str = "exact",
        *,
        tolerance: Optional[float] = None,
        rays: Optional[int] = None,
        points: Optional[int] = None,
        resolution: Optional[int] = None,
        sequence: Optional[str] = None,
        seed: Optional[int] = None,
        normalise: bool = False,
        budget: Optional[int] = None,
        row_tolerance: Optional[float] = None,
        balance: str = "auto",
        closed: Optional[bool] = None,
        time_limit: Optional[float] = None,
        memory_limit: Optional[int] = None,
        storage: str = "auto",
        precision: Optional[str] = None,
        scratch: Optional[Path] = None,
        checkpoint: Optional[Path] = None,
        progress: Progress = None,
    ) -> FormFactors:
        """Computes form factors (view factors) between all patches; a row of their matrix is from i to j.

        Parameters
        ----------
        method : str
            ``exact`` (default), ``sr``, ``sg``, ``sg5``, ``sg10``, ``hemicube``, ``centre``, ``pdm``,
            ``gauss-lambert``, ``contour``, ``closed-form`` or ``qmc``: `docs/methods.md` has their sources.
        tolerance : float, optional
            With ``exact``: the error that A_i F_ij / min(A_i, A_j) may have. Default 1e-6.
        rays : int, optional
            Rays for each patch if the method shoots, for each pair with ``qmc``.
        points, resolution, budget : int, optional
            Points along each side of a patch; cells along each edge of the hemicube; evaluations for a pair.
        row_tolerance : float, optional
            With ``exact``: the error that the sum of each row may have, in place of `tolerance`.
        sequence : {"sobol", "random"}, optional
            Where the numbers of shooting come from.
        seed : int, optional
            The same seed gives the same numbers at any number of threads.
        normalise : bool
            Divide rows by their sums, with ``centre``.
        balance : {"auto", "on", "closure", "off"}
            Whether form factors are made symmetric and their row sums restored.
        closed : bool, optional
            A statement that no light leaves the scene, or that it does; found from the scene by default.
        time_limit : float, optional
            Seconds: method and tolerance are chosen for it.
        memory_limit : int, optional
            The most memory to use, bytes. Default 80 % of the available memory.
        storage : {"auto", "dense", "symmetric", "sparse", "disk"}
            How they are kept; ``disk`` is a scratch file.
        precision : {"f64", "f32"}, optional
            The stored precision.
        scratch, checkpoint : path, optional
            The directory of the scratch file; a file for finished work, from which the same call continues.
        progress : bool or callable, optional
            As of `Model`.

        Returns
        -------
        FormFactors
            F[i, j] is the fraction of the light leaving patch i that reaches patch j, with its error.

        Raises
        ------
        FormFactorError
            If the method is not known or has no use for a setting.
        SceneError
            With ``closed=True``, if light leaves the scene.
        MemoryLimitError
            If they fit neither the memory nor the disk.
        """
        options = given(
            method=method,
            tolerance=tolerance,
            rays=rays,
            points=points,
            resolution=resolution,
            sequence=sequence,
            seed=seed,
            normalise=normalise,
            budget=budget,
            row_tolerance=row_tolerance,
            balance=balance,
            closed=closed,
            time_limit=time_limit,
            memory_limit=memory_limit,
            storage=storage,
            precision=precision,
            scratch=optional_path("scratch", scratch),
            checkpoint=optional_path("checkpoint", checkpoint),
        )
        with Bar(progress) as callback:
            return FormFactors(self._core.form_factors(options, callback), self)

    def solve(
        self,
        form_factors: Optional[FormFactors] = None,
        *,
        reflectance: Optional[ArrayLike] = None,
        exitance: Optional[ArrayLike] = None,
        sun: Optional[Sun] = None,
        sky: Optional[float] = None,
        solver: str = "auto",
        tolerance: Optional[float] = None,
        max_passes: Optional[int] = None,
        start: str = "exitance",
        omega: Optional[float] = None,
        bounds: Optional[str] = None,
        restart: Optional[int] = None,
        depth: Optional[int] = None,
        deflation: Optional[str] = None,
        steps_per_pass: Optional[int] = None,
        progress: Progress = None,
    ) -> Solution:
        """Solves for the radiosities, B = E + rho (D + F B), with F from patch i to patch j and D straight from sun and sky.

        Parameters
        ----------
        form_factors : FormFactors, optional
            Of this model; computed with the defaults of `form_factors` by default.
        reflectance : float or array_like, (n,), (n, k) or (n, k, 3), optional
            rho of each patch, in place of the scene's.
        exitance : float or array_like, (n,), (n, k) or (n, k, 3), optional
            E of each patch, W/m2, in place of the scene's: k lightings, gray or coloured, are solved in the
            same passes over F.
        sun : dict, optional
            ``irradiance`` of a plane that faces the sun, W/m2 (a number or three), with ``direction`` or
            ``latitude``, ``longitude``, ``time`` (RFC 3339) and ``north``; ``angular_radius`` in degrees.
            Shadows are exact. Only with the scene's own materials.
        sky : float, optional
            The irradiance of an unoccluded plane that faces up (z), W/m2, from a sky that is uniform over
            the hemisphere. Only with the scene's own materials.
        solver : str
            ``auto`` (default), ``pcg``, ``gmres``, ``jacobi``, ``gauss-seidel``, ``direct`` and others:
            `docs/methods.md` lists them with their sources.
        tolerance : float, optional
            On sqrt(sum A r^2 / sum A E^2), the worst channel. Default 1e-6.
        max_passes : int, optional
            The most passes over F. Default 1000.
        start : {"exitance", "zero", "ambient"}
            The first radiosities.
        omega, bounds, restart, depth, deflation, steps_per_pass
            Settings of single solvers.
        progress : bool or callable, optional
            As of `Model`.

        Returns
        -------
        Solution
            Its arrays have the shape of `exitance`, or of `reflectance`, if one is given.

        Raises
        ------
        ArgumentError
            If an array has a wrong shape or values.
        SolverError
            If patches emit and reflect everything, and no light leaves, or if a setting is not used.
        """
        if form_factors is None:
            form_factors = self.form_factors(progress=progress)
        instance("form_factors", form_factors, FormFactors)
        materials, shape = self._materials(reflectance, exitance)
        options = given(
            solver=solver,
            tolerance=tolerance,
            max_passes=max_passes,
            start=start,
            omega=omega,
            bounds=bounds,
            restart=restart,
            depth=depth,
            deflation=deflation,
            steps_per_pass=steps_per_pass,
            sun=table("sun", sun),
            sky=sky,
        )
        with Bar(progress) as callback:
            solution = self._core.solve(form_factors._core, materials, options, callback)
        return Solution(solution, self, form_factors, shape)

    def _materials(
        self, reflectance: Optional[ArrayLike], exitance: Optional[ArrayLike]
    ) -> tuple[Optional[tuple[Floats, Floats]], Optional[tuple[int, ...]]]:
        """Returns rho and E as columns of one shape, and that shape; None for those of the scene."""
        if reflectance is None and exitance is None:
            return None, None
        n = self.n_patches
        rho = self.reflectance if reflectance is None else of_patches("reflectance", reflectance, n)
        e = self.exitance if exitance is None else of_patches("exitance", exitance, n)
        for name, values, limit in (("reflectance", rho, 1.0), ("exitance", e, np.inf)):
            wrong = np.argwhere((values < 0.0) | (values > limit))
            if len(wrong):
                raise ArgumentError(f"{name}: {values[tuple(wrong[0])]} of patch {wrong[0][0]} is outside [0, {limit}]")
        shape = e.shape if e.ndim >= rho.ndim else rho.shape
        columns = []
        for name, values in (("reflectance", rho), ("exitance", e)):
            fits = _fitted(values, shape)
            if fits is None:
                raise ArgumentError(f"{name}: shape {values.shape} does not go along with {shape}")
            columns.append(np.ascontiguousarray(fits.reshape(n, -1)))
        return (columns[0], columns[1]), shape

    def render(
        self,
        solution: Solution,
        *,
        eye: Optional[Sequence[float]] = None,
        look_at: Optional[Sequence[float]] = None,
        up: Optional[Sequence[float]] = None,
        fov: Optional[float] = None,
        width: Optional[int] = None,
        height: Optional[int] = None,
        camera: Optional[Path] = None,
        samples: Optional[int] = None,
        direct: Optional[str] = None,
        flat: Optional[bool] = None,
        final_gather: Optional[bool] = None,
        noise: Optional[float] = None,
        seed: Optional[int] = None,
        progress: Progress = None,
    ) -> Image:
        """Renders a solution.

        Parameters
        ----------
        solution : Solution
            Of this model, with one channel or three.
        eye, look_at : sequence of 3 float, optional
            The position of the camera, and the point at which it looks, m. By default from the file beside the
            scene, or chosen for the scene.
        up : sequence of 3 float, optional
            The direction that is up in the image. Default z.
        fov : float, optional
            The vertical field of view, degrees.
        width, height : int, optional
            Pixels. Default 512 square.
        camera : path, optional
            A camera's TOML file, or ``"unfolded"`` for one orthographic tile for each planar surface.
        samples : int, optional
            samples^2 for each pixel. Default 2.
        direct : {"polygons", "exact", "rays", "off"}, optional
            The method for direct light from the emitters at each pixel; "off" under sun and sky.
        flat : bool, optional
            Show the radiosity of each patch. This is always so for a solution with reflectances or exitances of
            single patches, which a scene cannot hold.
        final_gather : bool, optional
            Gather light between surfaces by rays at each pixel, as many as `noise` needs.
        noise : float, optional
            The relative standard error that a pixel may have, with `final_gather`.
        seed : int, optional
            Of all random numbers.
        progress : bool or callable, optional
            As of `Model`.

        Returns
        -------
        Image
            Radiance, float32, (height, width, 3), and layers.

        Raises
        ------
        ArgumentError
            If settings do not fit together.
        SceneError
            If the camera cannot be read.
        """
        options = given(
            eye=vector("eye", eye),
            look_at=vector("look_at", look_at),
            up=vector("up", up),
            fov=fov,
            width=width,
            height=height,
            camera=optional_path("camera", camera),
            samples=samples,
            direct=direct,
            flat=flat,
            final_gather=final_gather,
            noise=noise,
            seed=seed,
        )
        with Bar(progress) as callback:
            return Image(self._core.render(instance("solution", solution, Solution)._core, options, callback))

    def field(
        self,
        surface: str,
        *,
        method: str = "exact",
        rays: Optional[int] = None,
        sequence: Optional[str] = None,
        seed: Optional[int] = None,
        eye: Optional[Sequence[float]] = None,
        look_at: Optional[Sequence[float]] = None,
        up: Optional[Sequence[float]] = None,
        fov: Optional[float] = None,
        width: Optional[int] = None,
        height: Optional[int] = None,
        camera: Optional[Path] = None,
        samples: Optional[int] = None,
        memory_limit: Optional[int] = None,
        progress: Progress = None,
    ) -> Image:
        """Renders the form factor from every visible point i to a surface j: F from a point with the normal of its face.

        Parameters
        ----------
        surface : str
            The name of the surface j.
        method : {"exact", "sr", "qmc"}
            Exact by clipping; rays from the point, with a standard error for every pixel; or exact times the
            visible fraction of low-discrepancy rays.
        rays : int, optional
            Rays for each sample of a pixel with ``sr`` (default 4096), for each face of `surface` with ``qmc``
            (default 64).
        sequence : {"sobol", "random"}, optional
            Where the numbers of rays come from.
        eye, look_at, up, fov, width, height, camera, samples, seed, progress
            As of `render`.
        memory_limit : int, optional
            The most memory to use, bytes.

        Returns
        -------
        Image
            The layers are in `docs/pictures.md`; `Image.surfaces` has the mean of each surface.

        Raises
        ------
        ArgumentError
            If there is no such surface, or settings do not fit together.
        """
        if instance("surface", surface, str) not in self.surfaces:
            raise ArgumentError(f"surface: there is no {surface!r}; the scene has {', '.join(self.surfaces[:12])}")
        options = given(
            method=method,
            rays=rays,
            sequence=sequence,
            seed=seed,
            eye=vector("eye", eye),
            look_at=vector("look_at", look_at),
            up=vector("up", up),
            fov=fov,
            width=width,
            height=height,
            camera=optional_path("camera", camera),
            samples=samples,
            memory_limit=memory_limit,
        )
        with Bar(progress) as callback:
            image, means = self._core.field(self.surfaces.index(surface), options, callback)
        return Image(image, json.loads(means))

    def render_frames(
        self,
        frames: Frames,
        output: Path,
        *,
        form_factors: Optional[Mapping[str, Any]] = None,
        sun: Optional[Sun] = None,
        sky: Optional[float] = None,
        solver: str = "auto",
        tolerance: Optional[float] = None,
        max_passes: Optional[int] = None,
        eye: Optional[Sequence[float]] = None,
        look_at: Optional[Sequence[float]] = None,
        up: Optional[Sequence[float]] = None,
        fov: Optional[float] = None,
        width: Optional[int] = None,
        height: Optional[int] = None,
        camera: Optional[Path] = None,
        samples: Optional[int] = None,
        direct: Optional[str] = None,
        flat: Optional[bool] = None,
        final_gather: Optional[bool] = None,
        noise: Optional[float] = None,
        seed: Optional[int] = None,
        checkpoint: Optional[Path] = None,
        progress: Progress = None,
    ) -> dict[str, Any]:
        """Renders a sequence of lightings, cameras and positions of surfaces into files.

        Form factors that stay the same are computed once, and the lightings of one pose are solved
        together.

        Parameters
        ----------
        frames : path or sequence of dict
            A TOML file, or its frames: each has a ``name``, and as far as they differ from the scene's own a
            ``lighting`` and a ``camera`` (paths of TOML files) and ``move``, a list of motions such as
            ``{"surface": "door", "rotate": 30.0}``.
        output : path
            ``B.exr``: frame NAME is written as ``B-NAME.exr``, with a preview ``B-NAME.png``.
        form_factors : dict, optional
            Keyword arguments of `form_factors`.
        sun, sky, solver, tolerance, max_passes
            As of `solve`.
        eye, look_at, up, fov, width, height, camera, samples, direct, flat, final_gather, noise, seed
            As of `render`.
        checkpoint : path, optional
            A file for finished work, from which the same call continues.
        progress : bool or callable, optional
            As of `Model`.

        Returns
        -------
        dict
            By the names of `radiosity render --frames --json`: ``frames`` with their files and the mean
            radiosity of each surface, and ``poses``.

        Raises
        ------
        SceneError
            If the list, a lighting or a camera is wrong; the message has the line.
        """
        options = given(
            form_factors=table("form_factors", form_factors),
            sun=table("sun", sun),
            sky=sky,
            solver=solver,
            tolerance=tolerance,
            max_passes=max_passes,
            eye=vector("eye", eye),
            look_at=vector("look_at", look_at),
            up=vector("up", up),
            fov=fov,
            width=width,
            height=height,
            camera=optional_path("camera", camera),
            samples=samples,
            direct=direct,
            flat=flat,
            final_gather=final_gather,
            noise=noise,
            seed=seed,
            checkpoint=optional_path("checkpoint", checkpoint),
        )
        with Bar(progress) as callback:
            text = self._core.render_frames(frames_text(frames), path_of("output", output), options, callback)
        found: dict[str, Any] = json.loads(text)
        return found

    def voxels(
        self,
        n: int = 100,
        *,
        radius: int = 20,
        passes: Optional[int] = None,
        form: Optional[str] = None,
        adaptive: Optional[float] = None,
        coarsest: Optional[int] = None,
        solver: Optional[str] = None,
        tolerance: Optional[float] = None,
        unnormalised: bool = False,
        plain_emission: bool = False,
        exact_solid_angles: bool = False,
        links: Optional[str] = None,
        link_file: Optional[Path] = None,
        closed: Optional[bool] = None,
        memory_limit: Optional[int] = None,
        progress: Progress = None,
    ) -> VoxelSolution:
        """Solves for light on voxels, linked by integer lines: discrete radiosity, without form factors.

        Parameters
        ----------
        n : int
            Voxels along the longest axis, 4 to 4096.
        radius : int
            The radius of the discrete sphere of directions, 1 to 255.
        passes : int, optional
            Propagations of light. Default 10.
        form : {"in-place", "jacobi"}, optional
            Whether a propagation uses the newest values or those of the previous one.
        adaptive : float, optional
            Join voxels to cells where the irradiance changes by less than this part of its mean.
        coarsest : int, optional
            With `adaptive`: the largest cells are 2^coarsest voxels wide, up to 2^6. Default 3.
        solver, tolerance : str and float, optional
            Solve to a tolerance, in place of a number of passes; as of `solve`.
        unnormalised, plain_emission, exact_solid_angles : bool
            Leave the weights of a voxel's directions as they are; let every voxel of an emitter send its
            exitance; weigh directions by exact solid angles.
        links : {"auto", "memory", "disk", "recompute"}, optional
            The place of links between passes.
        link_file : path, optional
            The file of links on a disk. Default: the name of the scene's file with ``.links``.
        closed : bool, optional
            As of `form_factors`.
        memory_limit : int, optional
            The most memory to use, bytes.
        progress : bool or callable, optional
            As of `Model`.

        Returns
        -------
        VoxelSolution

        Raises
        ------
        ArgumentError, MemoryLimitError
            If settings do not fit together, or the voxels do not fit the memory.
        """
        options = given(
            n=n,
            radius=radius,
            passes=passes,
            form=form,
            adaptive=adaptive,
            coarsest=coarsest,
            solver=solver,
            tolerance=tolerance,
            unnormalised=unnormalised,
            plain_emission=plain_emission,
            exact_solid_angles=exact_solid_angles,
            links=links,
            link_file=optional_path("link_file", link_file),
            closed=closed,
            memory_limit=memory_limit,
        )
        with Bar(progress) as callback:
            return VoxelSolution(self._core.voxels(options, callback), self)

    def heat(
        self,
        boundary: Boundary,
        form_factors: Optional[FormFactors] = None,
        *,
        sun: Optional[Sun] = None,
        sky: Optional[float] = None,
        solver: str = "auto",
        tolerance: Optional[float] = None,
        max_passes: Optional[int] = None,
        progress: Progress = None,
    ) -> Heat:
        """Computes temperatures and net heat fluxes for boundary conditions, each with its error.

        Parameters
        ----------
        boundary : path or dict
            A TOML file, or a dict of the same: ``surroundings``, ``sun``, ``sky``, ``surface`` (a list of
            entries with a ``name``, or a dict by names; ``*`` in a name stands for any text) and ``node``.
            A surface has ``emissivity``, ``absorptance`` and one condition of ``temperature_k``,
            ``supplied_w_m2``, ``adiabatic``, ``node`` and ``other_side``. Numbers may be arrays over
            patches, (n,) of the model or one for each patch of the surface.
        form_factors : FormFactors, optional
            Of this model, from patch i to patch j; computed with the defaults of `form_factors` by default.
        sun : dict, optional
            In place of that of `boundary`; as of `solve`, with one irradiance.
        sky : float, optional
            The irradiance of an unoccluded plane that faces up, W/m2, in place of that of `boundary`.
        solver, tolerance, max_passes, progress
            As of `solve`.

        Returns
        -------
        Heat

        Raises
        ------
        SceneError
            If a boundary condition is wrong; the message names the line of the file, or the entry of the dict.
        HeatError
            If the conditions determine no temperature.
        """
        if form_factors is None:
            form_factors = self.form_factors(progress=progress)
        instance("form_factors", form_factors, FormFactors)
        parts = boundary_parts(boundary)
        options = _heat_options(sun, sky, solver, tolerance, max_passes)
        with Bar(progress) as callback:
            return Heat(self._core.heat(form_factors._core, parts, options, callback), form_factors)

    def along_sun_path(
        self,
        sun_path: Union[Path, ArrayLike],
        form_factors: Optional[FormFactors] = None,
        *,
        boundary: Optional[Boundary] = None,
        sky: Union[None, float, Sequence[float]] = None,
        north: Sequence[float] = (0.0, 1.0, 0.0),
        angular_radius: float = 0.0,
        solver: str = "auto",
        tolerance: Optional[float] = None,
        max_passes: Optional[int] = None,
        checkpoint: Optional[Path] = None,
        progress: Progress = None,
    ) -> SunPath:
        """Computes the light of the scene's own materials, or with `boundary` temperatures, at many times of the sun.

        Parameters
        ----------
        sun_path : path or array_like, (k, 5)
            A table (CSV) with the columns ``time``, ``irradiance`` and ``x``, ``y``, ``z`` or ``latitude``,
            ``longitude``, or rows of time, x, y, z (towards the sun, of any length) and the irradiance of a
            plane that faces the sun, W/m2. Times increase; dates are in RFC 3339.
        form_factors : FormFactors, optional
            Of this model, from patch i to patch j; computed with the defaults of `form_factors` by default.
            They serve all times.
        boundary : path or dict, optional
            As of `heat`. Surfaces store no heat: each time is a steady state of its own.
        sky : float or three, optional
            As of `solve`.
        north, angular_radius
            Of the scene, for places on Earth, and of the sun's disc in degrees.
        solver, tolerance, max_passes
            As of `solve`.
        checkpoint : path, optional
            A file for finished times, from which the same call continues after an interruption.
        progress : bool or callable, optional
            As of `Model`.

        Returns
        -------
        SunPath

        Raises
        ------
        FileError
            If the table is wrong; the message has its line.
        """
        if form_factors is None:
            form_factors = self.form_factors(progress=progress)
        instance("form_factors", form_factors, FormFactors)
        file, rows = None, None
        if isinstance(sun_path, (str, os.PathLike)):
            file = path_of("sun_path", sun_path)
        else:
            rows = floats("sun_path", cast("ArrayLike", sun_path))
            if rows.ndim != 2:
                raise ArgumentError(f"sun_path: shape {rows.shape}, expected (k, 5)")
        options = given(
            sky=sky if sky is None or isinstance(sky, (int, float)) else vector("sky", sky),
            north=vector("north", north),
            angular_radius=angular_radius,
            solver=solver,
            tolerance=tolerance,
            max_passes=max_passes,
            checkpoint=optional_path("checkpoint", checkpoint),
        )
        parts = None if boundary is None else boundary_parts(boundary)
        with Bar(progress) as callback:
            return SunPath(*self._core.along_sun_path(form_factors._core, (file, rows), parts, options, callback))

    def exchange_factors(
        self,
        boundary: Boundary,
        form_factors: Optional[FormFactors] = None,
        *,
        by: str = "surface",
        solver: str = "auto",
        tolerance: Optional[float] = None,
        max_passes: Optional[int] = None,
        progress: Progress = None,
    ) -> ExchangeFactors:
        """Computes Gebhart factors, script-F and conductors of a thermal network; a row is from i to j.

        Parameters
        ----------
        boundary : path or dict
            As of `heat`; only emissivities matter.
        form_factors : FormFactors, optional
            As of `heat`.
        by : {"surface", "patch"}
            The nodes.
        solver, tolerance, max_passes, progress
            As of `solve`.

        Returns
        -------
        ExchangeFactors

        Raises
        ------
        SceneError
            If a boundary condition is wrong.
        """
        if instance("by", by, str) not in ("surface", "patch"):
            raise ArgumentError(f"by: {by!r} is none of 'surface', 'patch'")
        if form_factors is None:
            form_factors = self.form_factors(progress=progress)
        instance("form_factors", form_factors, FormFactors)
        parts = boundary_parts(boundary)
        options = _heat_options(None, None, solver, tolerance, max_passes)
        with Bar(progress) as callback:
            found = self._core.exchange_factors(form_factors._core, parts, by == "patch", options, callback)
        return ExchangeFactors(*found)

    def points(
        self,
        xyz: ArrayLike,
        normals: Optional[ArrayLike] = None,
        *,
        heat: Optional[Heat] = None,
        person: bool = False,
        progress: Progress = None,
    ) -> PointViews:
        """Returns the views from free points: factors to all surfaces, and with heat the irradiance and the mean radiant temperature.

        Parameters
        ----------
        xyz : array_like, (k, 3)
            Positions, m.
        normals : array_like, (k, 3), optional
            The directions of the points, of any length. Points without a normal look all around.
        heat : Heat, optional
            Of this model, for the irradiances.
        person : bool
            Include the sun in the mean radiant temperature as a standing person absorbs it.
        progress : bool or callable, optional
            As of `Model`.

        Returns
        -------
        PointViews
            From point to surface; the factors of a point sum to 1 with ``surroundings`` and ``backs``.

        Raises
        ------
        ArgumentError
            If an array has a wrong shape, is not finite, or a normal has no length.
        """
        positions = point_array("xyz", xyz)
        directions = None
        if normals is not None:
            directions = point_array("normals", normals)
            if directions.shape != positions.shape:
                raise ArgumentError(f"normals: shape {directions.shape}, expected {positions.shape}, that of xyz")
            zero = np.flatnonzero(~directions.any(axis=1))
            if len(zero):
                raise ArgumentError(f"normals: that of point {zero[0]} has no length")
        with Bar(progress) as callback:
            core = None if heat is None else instance("heat", heat, Heat)._core
            return PointViews(self, self._core.points(positions, directions, core, flag("person", person), callback))

    def to_pyvista(self, **arrays: ArrayLike) -> Any:
        """Returns the patches as a `pyvista.PolyData`, with cell arrays ``surface`` and ``area_m2``.

        Parameters
        ----------
        **arrays : array_like, (n,) or (n, k)
            More cell arrays by name, such as ``radiosity=solution.radiosity``.

        Returns
        -------
        pyvista.PolyData
            The names of the surfaces are its field data ``surface_name``.
        """
        import pyvista

        vertices, corners, ends = self._core.geometry()
        counts = np.diff(ends, prepend=0)
        cells = np.insert(corners, ends - counts, counts)
        mesh = pyvista.PolyData(vertices, cells)
        mesh.cell_data["surface"] = self.patch_surface
        mesh.cell_data["area_m2"] = self.patch_area
        mesh.field_data["surface_name"] = np.array(self.surfaces)
        for name, values in arrays.items():
            array = floats(name, values)
            if array.ndim == 0 or len(array) != self.n_patches:
                raise ArgumentError(f"{name}: shape {array.shape}, expected ({self.n_patches},) or ({self.n_patches}, k)")
            mesh.cell_data[name] = array
        return mesh


def load(
    path: Path,
    model: Model,
    *,
    balance: str = "auto",
    memory_limit: Optional[int] = None,
    storage: str = "auto",
    precision: Optional[str] = None,
    scratch: Optional[Path] = None,
    progress: Progress = None,
) -> FormFactors:
    """Reads the form factors of a model from a file of `FormFactors.save` or the program; a row is from i to j.

    Parameters
    ----------
    path : path
        ``.npz``, ``.npy`` or ``.mtx``; the latter two hold no errors.
    model : Model
        With the patches of the form factors; materials may differ.
    balance, memory_limit, storage, precision, scratch, progress
        As of `Model.form_factors`.

    Returns
    -------
    FormFactors
        From patch i to patch j.

    Raises
    ------
    FileError
        If the file cannot be read, is damaged, or holds form factors of another geometry.
    """
    options = given(
        balance=balance,
        memory_limit=memory_limit,
        storage=storage,
        precision=precision,
        scratch=optional_path("scratch", scratch),
    )
    with Bar(progress) as callback:
        return FormFactors(instance("model", model, Model)._core.load_form_factors(path_of("path", path), options, callback), model)


def _fitted(values: Floats, shape: tuple[int, ...]) -> Optional[Floats]:
    """Returns values for every channel of a shape: gray ones for all channels, coloured ones for each lighting."""
    if values.shape == shape:
        return values
    if values.ndim == 1:
        return np.broadcast_to(values.reshape(-1, *[1] * (len(shape) - 1)), shape)
    if len(shape) == 3 and values.ndim == 2:
        # (n, 3) is the colour of a scene, (n, k) gray values of each lighting.
        if values.shape[1] == 3 and shape[1] != 3:
            return np.broadcast_to(values[:, np.newaxis, :], shape)
        if values.shape[1] == shape[1] and shape[1] != 3:
            return np.broadcast_to(values[:, :, np.newaxis], shape)
    return None


def _heat_options(
    sun: Optional[Sun],
    sky: Optional[float],
    solver: str,
    tolerance: Optional[float],
    max_passes: Optional[int],
) -> dict[str, Any]:
    return given(
        sun=table("sun", sun),
        sky=sky,
        solver=solver,
        tolerance=tolerance,
        max_passes=max_passes,
    )


