//! Patches: the subdivision of faces, and values between patches.

use glam::{DQuat, DVec3};

use radiosity::geometry::polygon;
use radiosity::matrix::operator::Block;
use radiosity::mesh::{Mesh, MeshError, Patch, PatchId, Subdivision};
use radiosity::scene::{Corners, Face, FaceId, Material, MaterialId, Pose, Scene, Surface, SurfaceId};

mod at_walls;

/// A scene of the given faces with one material and one surface.
fn scene(vertices: Vec<DVec3>, faces: &[Corners]) -> Scene {
    Scene {
        vertices,
        faces: faces
            .iter()
            .map(|&corners| Face {
                corners,
                surface: SurfaceId(0),
                material: MaterialId(0),
                line: 0,
            })
            .collect(),
        surfaces: vec![Surface { name: "s".into() }],
        materials: vec![Material {
            name: "m".into(),
            reflectance: [0.5; 3],
            exitance: [0.0; 3],
        }],
        ..Scene::default()
    }
}

/// A quad 2 × 1 in the plane z = 0 and a triangle that continues it, then one that rises from it.
fn quad_and_triangles() -> Scene {
    scene(
        vec![
            DVec3::new(0.0, 0.0, 0.0),
            DVec3::new(2.0, 0.0, 0.0),
            DVec3::new(2.0, 1.0, 0.0),
            DVec3::new(0.0, 1.0, 0.0),
            DVec3::new(3.0, 0.4, 0.0),
            DVec3::new(0.7, 2.0, 1.0),
        ],
        &[
            Corners::Quad([0, 1, 2, 3]),
            Corners::Triangle([2, 1, 4]),
            Corners::Triangle([3, 2, 5]),
        ],
    )
}

#[test]
fn patches_fill_their_face_and_lie_where_they_are_found() {
    let mut source = quad_and_triangles();
    source.faces[1].corners = Corners::Triangle([1, 4, 2]);
    for subdivision in [
        Subdivision::Uniform(1),
        Subdivision::Uniform(5),
        Subdivision::MaxEdge(0.23),
    ] {
        let mesh = Mesh::new(&source, subdivision).unwrap();
        for face in source.face_ids() {
            let whole = source.area_vector(face);
            let parts: DVec3 = mesh
                .patches
                .iter()
                .filter(|p| p.face == face)
                .map(|p| {
                    polygon::area_vector(
                        &p.corners
                            .as_slice()
                            .iter()
                            .map(|&v| mesh.vertices[v as usize])
                            .collect::<Vec<_>>(),
                    )
                })
                .sum();
            assert!((whole - parts).length() < 1e-14, "{subdivision:?} {face:?}");
        }
        for (k, patch) in mesh.patches.iter().enumerate() {
            let corners = source.polygon(patch.face);
            let (e, f) = (corners[1] - corners[0], corners[corners.len() - 1] - corners[0]);
            let h = patch.centroid - corners[0];
            let (ee, ef, ff) = (e.dot(e), e.dot(f), f.dot(f));
            let det = ee * ff - ef * ef;
            let u = (h.dot(e) * ff - h.dot(f) * ef) / det;
            let v = (h.dot(f) * ee - h.dot(e) * ef) / det;
            let point = mesh.locate(patch.face, u, v);
            assert_eq!(point.patch.0 as usize, k);
            assert_eq!(mesh.patch_at(patch.face, u, v), point.patch);
            let back: DVec3 = mesh
                .polygon(point.patch)
                .iter()
                .zip(point.weights)
                .map(|(&p, w)| w * p)
                .sum();
            assert!(back.distance(patch.centroid) < 1e-14);
        }
    }
}

#[test]
fn flat_neighbours_share_vertices_and_a_crease_does_not() {
    let mut source = quad_and_triangles();
    source.faces[1].corners = Corners::Triangle([1, 4, 2]);
    for subdivision in [Subdivision::Uniform(4), Subdivision::MaxEdge(0.3)] {
        let mesh = Mesh::new(&source, subdivision).unwrap();
        let used = |face: u32| -> std::collections::BTreeSet<u32> {
            let own = mesh.patches.iter().filter(|p| p.face == FaceId(face));
            own.flat_map(|p| p.corners.as_slice().to_vec()).collect()
        };
        let (quad, flat, risen) = (used(0), used(1), used(2));
        let on_joint = |v: &u32| (mesh.vertices[*v as usize].x - 2.0).abs() < 1e-12;
        let joint: Vec<u32> = quad.iter().copied().filter(on_joint).collect();
        assert_eq!(joint, flat.iter().copied().filter(on_joint).collect::<Vec<_>>());
        assert!(joint.len() >= 5);
        assert!(quad.is_disjoint(&risen));
        // At the crease both planes have the same positions, bit for bit.
        let place = |v: &u32| mesh.vertices[*v as usize].to_array().map(f64::to_bits);
        let ridge = |set: &std::collections::BTreeSet<u32>| -> std::collections::BTreeSet<[u64; 3]> {
            set.iter()
                .filter(|&&v| {
                    (mesh.vertices[v as usize].y - 1.0).abs() < 1e-12 && mesh.vertices[v as usize].z.abs() < 1e-12
                })
                .map(place)
                .collect()
        };
        if subdivision == Subdivision::Uniform(4) {
            assert_eq!(ridge(&quad), ridge(&risen));
        }
    }
}

#[test]
fn max_edge_is_kept_and_not_overdone() {
    let source = quad_and_triangles();
    let mesh = Mesh::new(&source, Subdivision::MaxEdge(0.5)).unwrap();
    let quad = mesh.patches.iter().filter(|p| p.face == FaceId(0)).count();
    // Four by two would do for the quad alone; its flat neighbour has an edge of 1.08 m, and takes the quad along.
    assert_eq!(quad, 4 * 3);
    for patch in 0..mesh.n_patches() {
        let corners = mesh.polygon(PatchId(u32::try_from(patch).unwrap()));
        for k in 0..corners.len() {
            assert!(corners[k].distance(corners[(k + 1) % corners.len()]) <= 0.5 * (1.0 + 1e-9));
        }
    }
}

#[test]
fn vertex_values_keep_constants_and_linear_fields_inside() {
    let source = quad_and_triangles();
    let mesh = Mesh::new(&source, Subdivision::Uniform(6)).unwrap();
    let constant = mesh.vertex_values(&Block::from_values(vec![0.7; mesh.n_patches()], 1));
    assert!(constant.values().iter().all(|v| (v - 0.7).abs() < 1e-15));
    let field = |p: DVec3| 1.0 + 2.0 * p.x - 0.5 * p.y;
    let per_patch = mesh.patches.iter().map(|p| field(p.centroid)).collect();
    let at_vertices = mesh.vertex_values(&Block::from_values(per_patch, 1));
    let mut n_inside = 0;
    for (k, v) in mesh.vertices.iter().enumerate() {
        let inside_quad = v.z.abs() < 1e-12 && v.x > 0.1 && v.x < 1.9 && v.y > 0.1 && v.y < 0.9;
        if inside_quad {
            n_inside += 1;
            assert!((at_vertices.row(k)[0] - field(*v)).abs() < 1e-12);
        }
    }
    assert_eq!(n_inside, 25);
}

/// A floor of a large quad beside three smaller ones, one of them in triangles: T-junctions along x = 1, and none at y = const.
fn floor_with_t_junctions() -> Scene {
    let v = |x: f64, y: f64| DVec3::new(x, y, 0.2 * x + 0.1 * y);
    scene(
        vec![
            v(0.0, 0.0),
            v(1.0, 0.0),
            v(1.0, 1.0),
            v(0.0, 1.0),
            v(1.0, 0.35),
            v(1.0, 0.8),
            v(1.7, 0.0),
            v(1.7, 0.35),
            v(1.7, 0.8),
            v(1.7, 1.0),
        ],
        &[
            Corners::Quad([0, 1, 2, 3]),
            Corners::Quad([1, 6, 7, 4]),
            Corners::Triangle([4, 7, 8]),
            Corners::Triangle([4, 8, 5]),
            Corners::Quad([5, 8, 9, 2]),
        ],
    )
}

#[test]
fn interpolation_has_no_seam_at_t_junctions() {
    let source = floor_with_t_junctions();
    for subdivision in [
        Subdivision::Uniform(1),
        Subdivision::Uniform(2),
        Subdivision::Uniform(3),
        Subdivision::MaxEdge(0.3),
    ] {
        let mesh = Mesh::new(&source, subdivision).unwrap();
        // Values without any order, so that neighbours differ.
        let wild = |k: usize| ((k as f64 + 1.0) * 12.9898).sin().abs() * 3.0;
        let values: Vec<f64> = (0..mesh.n_patches()).map(wild).collect();
        let at_vertices = mesh.vertex_values(&Block::from_values(values, 1));
        let value = |face: u32, u: f64, v: f64| {
            let (mut sum, mut total) = (0.0, 0.0);
            mesh.interpolate(&mesh.locate(FaceId(face), u, v), |vertex, weight| {
                assert!((-1e-12..=1.0 + 1e-12).contains(&weight));
                total += weight;
                sum += weight * at_vertices.row(vertex)[0];
            });
            assert!((total - 1.0).abs() < 1e-12);
            sum
        };
        for k in 0..=400 {
            let y = f64::from(k) / 400.0;
            let left = value(0, 1.0, y);
            let right = if y <= 0.35 {
                value(1, 0.0, y / 0.35)
            } else if y <= 0.8 {
                value(3, 0.0, (y - 0.35) / 0.45)
            } else {
                value(4, 0.0, (y - 0.8) / 0.2)
            };
            // Points of the two sides differ by roundings, values by as much times their slope.
            assert!((left - right).abs() < 1e-9, "{subdivision:?} {y}: {left} {right}");
            // And on the way to the line: the last 1e-7 m change the value by no more than the slope.
            let near = value(0, 1.0 - 1e-7, y);
            assert!((left - near).abs() < 1e-4, "{subdivision:?} {y}: {left} {near}");
        }
    }
    // A constant stays, and a linear function of the vertices is kept.
    let mesh = Mesh::new(&source, Subdivision::Uniform(2)).unwrap();
    let linear = |p: DVec3| 1.0 + 2.0 * p.x - 0.5 * p.y;
    for (u, v) in [(0.97, 0.2), (0.6, 0.9), (0.99, 0.36)] {
        let mut sum = 0.0;
        mesh.interpolate(&mesh.locate(FaceId(0), u, v), |vertex, weight| {
            sum += weight * linear(mesh.vertices[vertex]);
        });
        assert!((sum - linear(DVec3::new(u, v, 0.0))).abs() < 1e-12, "{u} {v}");
    }
}

/// A floor from (0, 0) to (4, 2), bright left of x = 2 and dark right of it, and walls on that line.
fn floor_with(walls: &[[DVec3; 4]], floor: &[[[f64; 2]; 4]]) -> Scene {
    let mut vertices: Vec<DVec3> = Vec::new();
    let mut faces = Vec::new();
    for quad in floor
        .iter()
        .map(|quad| quad.map(|[x, y]| DVec3::new(x, y, 0.0)))
        .chain(walls.iter().copied())
    {
        let first = u32::try_from(vertices.len()).unwrap();
        vertices.extend(quad);
        faces.push(Corners::Quad([0, 1, 2, 3].map(|k| first + k)));
    }
    scene(vertices, &faces)
}

/// Returns the floor's value at a point; which side counts on a border.
///
/// `mesh` is that of the scene turned by `turn`.
fn floor_value(source: &Scene, mesh: &Mesh, turn: DQuat, from_left: bool, [x, y]: [f64; 2]) -> f64 {
    let bright = |patch: &Patch| f64::from(u8::from((turn.inverse() * patch.centroid).x < 2.0));
    let values = mesh.vertex_values(&Block::from_values(mesh.patches.iter().map(bright).collect(), 1));
    let inside = x + if from_left { -1e-9 } else { 1e-9 };
    let face = source.face_ids().find(|&face| {
        let corners = source.polygon(face);
        corners[2].z == 0.0 && (corners[0].x..corners[2].x).contains(&inside)
    });
    let (face, mut sum) = (face.unwrap(), 0.0);
    let corners = source.polygon(face);
    let size = corners[2] - corners[0];
    let at = mesh.locate(face, (inside - corners[0].x) / size.x, y / size.y);
    mesh.interpolate(&at, |vertex, weight| sum += weight * values.row(vertex)[0]);
    sum
}

#[test]
fn values_do_not_leak_through_walls() {
    let whole = [[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [0.0, 2.0]];
    let halves = [
        [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]],
        [[2.0, 0.0], [4.0, 0.0], [4.0, 2.0], [2.0, 2.0]],
    ];
    let wall = |low: f64, high: f64, lean: f64| {
        [(0.0, low), (1.0, low), (1.0, high), (0.0, high)].map(|(y, z)| DVec3::new(2.0 + lean * z, y, z))
    };
    let welded = |source: Scene| {
        // Faces that share vertices, as exporters write them.
        let same = |v: &u32| {
            let place = source.vertices[*v as usize];
            u32::try_from(source.vertices.iter().position(|&other| other == place).unwrap()).unwrap()
        };
        let faces = source.faces.iter().map(|face| match face.corners {
            Corners::Quad(v) => Corners::Quad(v.each_ref().map(same)),
            Corners::Triangle(v) => Corners::Triangle(v.each_ref().map(same)),
        });
        scene(source.vertices.clone(), &faces.collect::<Vec<_>>())
    };
    let is_parted = |source: &Scene, mesh: &Mesh, turn: DQuat| {
        let at = |from_left, y| floor_value(source, mesh, turn, from_left, [2.0, y]);
        let near = |value: f64, expected: f64| (value - expected).abs() < 1e-6;
        // Beyond the wall and at its end the floor is one; so it is everywhere if the wall does not stand on it.
        for y in [1.0, 1.2, 1.5, 2.0] {
            assert!(near(at(true, y), 0.5) && near(at(false, y), 0.5), "{y}");
        }
        let parted = [0.0, 0.1, 0.25, 0.5].map(|y| near(at(true, y), 1.0) && near(at(false, y), 0.0));
        let joined = [0.0, 0.1, 0.25, 0.5].map(|y| near(at(true, y), 0.5) && near(at(false, y), 0.5));
        assert!(parted == [true; 4] || joined == [true; 4], "{parted:?} {joined:?}");
        parted[0]
    };
    for (low, high, lean, expected) in [
        (0.0, 1.0, 0.0, true),
        (0.0, 1.0, 0.7, true),
        (-0.5, 1.0, 0.0, true),
        (-1.0, 0.0, 0.0, false),
        (0.25, 1.0, 0.0, false),
    ] {
        let wall = wall(low, high, lean);
        for source in [
            floor_with(&[wall], &[whole]),
            floor_with(&[wall], &halves),
            welded(floor_with(&[wall], &halves)),
        ] {
            for turn in [DQuat::IDENTITY, DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 1.1, -2.0)] {
                let mut turned = source.clone();
                turned.vertices.iter_mut().for_each(|v| *v = turn * *v);
                let mesh = Mesh::new(&turned, Subdivision::Uniform(4)).unwrap();
                assert_eq!(is_parted(&source, &mesh, turn), expected, "{low} {high} {lean} {turn}");
            }
        }
    }
    // Patches of other sizes on either side: the left ones reach from the wall's one end to the other.
    let quarters = [
        halves[0],
        [[2.0, 0.0], [4.0, 0.0], [4.0, 1.0], [2.0, 1.0]],
        [[2.0, 1.0], [4.0, 1.0], [4.0, 2.0], [2.0, 2.0]],
    ];
    let source = floor_with(&[wall(0.0, 1.0, 0.0)], &quarters);
    let mesh = Mesh::new(&source, Subdivision::Uniform(2)).unwrap();
    let at = |from_left, y| floor_value(&source, &mesh, DQuat::IDENTITY, from_left, [2.0, y]);
    for y in [0.0, 0.3, 0.5] {
        assert!(at(false, y).abs() < 1e-6, "{y}");
        let expected = 1.0 - y * (1.0 - at(true, 1.0));
        assert!((at(true, y) - expected).abs() < 1e-6, "{y}");
    }
    assert!((at(true, 1.0) - at(false, 1.0)).abs() < 1e-6 && at(true, 1.0) > 0.3);
}

/// The panels of a wall, and where on it edges are parted and where not.
type Case<'a> = (&'a [[f64; 2]], &'a [f64], &'a [f64]);

#[test]
fn walls_of_several_faces_part_as_those_of_one_do_and_doors_do_not() {
    let whole = [[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [0.0, 2.0]];
    let halves = [
        [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]],
        [[2.0, 0.0], [4.0, 0.0], [4.0, 2.0], [2.0, 2.0]],
    ];
    let sevenths: Vec<[f64; 2]> = (0..7)
        .map(|k| [f64::from(k), f64::from(k + 1)].map(|y| y / 7.0))
        .collect();
    let fortieths: Vec<[f64; 2]> = (0..40)
        .map(|k| [f64::from(k), f64::from(k + 1)].map(|y| y / 40.0))
        .collect();
    // Patches have vertices at multiples of a quarter. For each wall, by its panels: where the floor is parted, and where it is not.
    let cases: [Case; 8] = [
        (
            &[[0.0, 0.25], [0.25, 0.5], [0.5, 1.0]],
            &[0.0, 0.4, 0.75],
            &[1.0, 1.5, 2.0],
        ),
        (
            &[[0.0, 0.125], [0.125, 0.6], [0.6, 1.0]],
            &[0.0, 0.4, 0.75],
            &[1.0, 1.5],
        ),
        (&sevenths, &[0.0, 0.1, 0.4, 0.75], &[1.0, 1.5]),
        (&fortieths, &[0.0, 0.1, 0.4, 0.75], &[1.0, 1.5]),
        // Panels that overlap, in no order and of either sense.
        (&[[0.5, 1.0], [0.3, 0.0], [0.6, 0.1]], &[0.0, 0.4, 0.75], &[1.0, 1.5]),
        // Doors over edges of several patches, and inside that of one.
        (
            &[[0.0, 0.4], [0.4, 0.75], [1.25, 1.6], [1.6, 2.0]],
            &[0.0, 0.4, 0.5, 1.5, 2.0],
            &[0.75, 0.9, 1.0, 1.25],
        ),
        (
            &[[0.0, 0.4], [0.4, 0.85], [0.9, 1.3], [1.3, 2.0]],
            &[0.0, 0.5, 1.25, 2.0],
            &[0.75, 0.85, 0.875, 1.0],
        ),
        // One that is missing at each joint.
        (
            &[[0.0, 0.1], [0.15, 0.35], [0.4, 0.6], [0.65, 0.85], [0.9, 1.0]],
            &[],
            &[0.0, 0.2, 0.25, 0.5, 1.0],
        ),
    ];
    for (panels, parted, joined) in cases {
        for low in [0.0, -0.5] {
            let corners = |[from, to]: [f64; 2]| {
                [(from, low), (to, low), (to, 1.0), (from, 1.0)].map(|(y, z)| DVec3::new(2.0, y, z))
            };
            let walls: Vec<[DVec3; 4]> = panels.iter().copied().map(corners).collect();
            let mut sources = vec![floor_with(&walls, &[whole]), floor_with(&walls, &halves)];
            // Panels in triangles meet the floor in one line and a point, or in two lines.
            let mut triangles = sources[0].clone();
            for face in triangles.faces.split_off(1) {
                if let Corners::Quad([a, b, c, d]) = face.corners {
                    triangles.faces.extend([[a, b, c], [a, c, d]].map(|three| Face {
                        corners: Corners::Triangle(three),
                        ..face
                    }));
                }
            }
            sources.push(triangles);
            for source in sources {
                for turn in [DQuat::IDENTITY, DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 1.1, -2.0)] {
                    let mut turned = source.clone();
                    turned.vertices.iter_mut().for_each(|v| *v = turn * *v);
                    let mesh = Mesh::new(&turned, Subdivision::Uniform(8)).unwrap();
                    for (places, expected) in [(parted, [1.0, 0.0]), (joined, [0.5, 0.5])] {
                        for &y in places {
                            for (from_left, wanted) in [(true, expected[0]), (false, expected[1])] {
                                let found = floor_value(&source, &mesh, turn, from_left, [2.0, y]);
                                assert!((found - wanted).abs() < 1e-6, "{panels:?} {low} {turn} {y}: {found}");
                            }
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn a_wall_that_goes_away_parts_nothing_and_one_that_comes_does() {
    let standing = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)].map(|(y, z)| DVec3::new(2.0, y, z));
    let floor = [[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [0.0, 2.0]];
    let value = |source: &Scene, mesh: &Mesh| floor_value(source, mesh, DQuat::IDENTITY, true, [2.0, 0.25]);
    let shifted = |by: f64| {
        let mut source = floor_with(&[standing.map(|v| v + by * DVec3::Z)], &[floor]);
        source.surfaces.push(Surface { name: "wall".into() });
        source.faces[1].surface = SurfaceId(1);
        let mesh = Mesh::new(&source, Subdivision::Uniform(4)).unwrap();
        let mut pose = Pose::default();
        let up = radiosity::scene::Motion {
            surface: radiosity::scene::Names::Many(vec!["wall".into()]),
            rotate: None,
            axis: None,
            about: None,
            translate: Some([0.0, 0.0, 0.5]),
        };
        pose.push(&source, &up).unwrap();
        let raised = source.posed(&pose).unwrap();
        let moved = mesh.posed(&pose, &raised);
        [value(&source, &mesh), value(&raised, &moved)]
    };
    for (values, expected) in [(shifted(0.0), [1.0, 0.5]), (shifted(-1.0), [0.5, 1.0])] {
        for (found, wanted) in values.into_iter().zip(expected) {
            assert!((found - wanted).abs() < 1e-6, "{values:?}");
        }
    }
}

#[test]
fn impossible_subdivisions_are_refused() {
    let source = quad_and_triangles();
    assert_eq!(
        Mesh::new(&source, Subdivision::Uniform(0)).unwrap_err(),
        MeshError::ZeroParts
    );
    assert_eq!(
        Mesh::new(&source, Subdivision::MaxEdge(0.0)).unwrap_err(),
        MeshError::BadLength(0.0)
    );
    assert!(matches!(
        Mesh::new(&source, Subdivision::MaxEdge(f64::NAN)),
        Err(MeshError::BadLength(_))
    ));
    assert!(matches!(
        Mesh::new(&source, Subdivision::MaxEdge(1e-7)),
        Err(MeshError::TooManyPatches(_))
    ));
    assert!(matches!(
        Mesh::new(&source, Subdivision::Uniform(60_000)),
        Err(MeshError::TooManyPatches(_))
    ));
}
