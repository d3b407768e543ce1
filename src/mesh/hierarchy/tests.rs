#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use super::*;
use crate::mesh::Subdivision;
use crate::scene::builtin;

fn quad(n_u: u32, n_v: u32) -> FaceShape {
    FaceShape::Quad { n_u, n_v }
}

fn mesh(name: &str, level: Option<u32>, n: u32) -> Mesh {
    let scene = builtin::build(name, level).unwrap().scene;
    Mesh::new(&scene, Subdivision::Uniform(n)).unwrap()
}

#[test]
fn parts_halve_and_odd_ones_merge_three_in_one_place() {
    let hierarchy = Hierarchy::of_faces(&[quad(12, 1), quad(5, 4)], &[1.0; 32]);
    // 12 → 6 → 3 → 1 beside 5 · 4 → 2 · 2 → 1.
    assert_eq!(hierarchy.sizes(), [32, 6 + 4, 3 + 1, 1 + 1]);
    let first = &hierarchy.levels()[0];
    assert_eq!(first.children(0), [0, 1]);
    assert_eq!(first.children(6), [12, 13, 17, 18]);
    assert_eq!(first.children(7), [14, 15, 16, 19, 20, 21]);
    assert_eq!(hierarchy.levels()[1].children(2), [4, 5]);
}

#[test]
fn every_patch_is_the_union_of_its_children() {
    for (name, n) in [
        ("lewis-room", 5),
        ("cornell-box", 6),
        ("corridor", 7),
        ("sphere-room-r1", 1),
    ] {
        let mesh = mesh(name, (name == "lewis-room").then_some(1), n);
        let hierarchy = Hierarchy::of_mesh(&mesh);
        let mut areas = mesh.areas();
        let total: f64 = areas.iter().sum();
        for level in hierarchy.levels() {
            assert_eq!(level.n_fine(), areas.len());
            let mut seen = vec![0; level.n_fine()];
            for parent in 0..level.n_coarse() {
                let children = level.children(parent);
                assert!(!children.is_empty() && children.is_sorted());
                for &i in children {
                    seen[i as usize] += 1;
                }
                let shares: f64 = children.iter().map(|&i| level.shares()[i as usize]).sum();
                assert!((shares - 1.0).abs() < 1e-14, "{name}: {shares}");
                assert!(children.iter().all(|&i| level.parents()[i as usize] as usize == parent));
            }
            assert!(seen.iter().all(|&count| count == 1));
            areas = level.restricted_sums(&areas);
        }
        assert!((areas.iter().sum::<f64>() / total - 1.0).abs() < 1e-13);
    }
}

/// A room whose walls are cut into single faces has the same levels as one whose walls are grids of patches.
#[test]
fn walls_of_single_faces_become_as_coarse_as_walls() {
    let hierarchy = Hierarchy::of_mesh(&mesh("lewis-room", Some(3), 1));
    assert_eq!(hierarchy.sizes(), [384, 96, 24, 6]);
    assert_eq!(
        Hierarchy::of_mesh(&mesh("lewis-room", Some(0), 8)).sizes(),
        [384, 96, 24, 6]
    );
    let sphere = mesh("sphere-room-r2", None, 1);
    let sizes = Hierarchy::of_mesh(&sphere).sizes();
    assert!(sizes[0] == 992 && *sizes.last().unwrap() <= 6 + 16, "{sizes:?}");
    assert!(sizes.windows(2).all(|pair| 10 * pair[1] < 7 * pair[0]), "{sizes:?}");
}

/// Lewis's rule: 9, 3, 3, 1 sixteenths inside, linear along edges, the parent's value at corners.
#[test]
fn bilinear_weights() {
    let hierarchy = Hierarchy::of_faces(&[quad(8, 8)], &[1.0; 64]);
    let level = &hierarchy.levels()[0];
    let sorted = |patch: usize| {
        let mut stencil = level.bilinear(patch).to_vec();
        stencil.sort_by_key(|&(k, _)| k);
        stencil
    };
    assert_eq!(sorted(0), [(0, 1.0)]);
    assert_eq!(sorted(3), [(1, 0.75), (2, 0.25)]);
    assert_eq!(sorted(63), [(15, 1.0)]);
    let sixteenths = [(5, 9.0 / 16.0), (6, 3.0 / 16.0), (9, 3.0 / 16.0), (10, 1.0 / 16.0)];
    assert_eq!(sorted(3 * 8 + 3), sixteenths);
}

/// Bilinear values are exact for linear functions wherever a patch has the neighbours that it needs, whatever the merging.
#[test]
fn bilinear_values_keep_linear_functions() {
    let (n, m) = (11_usize, 5_usize);
    let hierarchy = Hierarchy::of_faces(&[quad(11, 11)], &[1.0; 121]);
    let level = &hierarchy.levels()[0];
    let function = |i: usize, j: usize| 2.0 * i as f64 - 0.5 * j as f64 + 1.0;
    let fine: Vec<f64> = (0..n * n).map(|k| function(k % n, k / n)).collect();
    let coarse = level.restricted(&fine);
    assert_eq!(coarse.len(), m * m);
    let [bilinear, injected] =
        [Prolongation::Bilinear, Prolongation::Injection].map(|prolongation| level.prolonged(prolongation, &coarse));
    for k in 0..n * n {
        let (i, j) = (k % n, k / n);
        let value = bilinear[k];
        let weights: f64 = level.bilinear(k).iter().map(|&(_, w)| w).sum();
        assert!((weights - 1.0).abs() < 1e-15 && level.bilinear(k).iter().all(|&(_, w)| w > 0.0));
        if (1..n - 1).contains(&i) && (1..n - 1).contains(&j) {
            assert!((value - fine[k]).abs() < 1e-13, "{i}, {j}: {value}");
        }
        assert!((injected[k] - coarse[level.parents()[k] as usize]).abs() < 1e-15);
    }
}

/// The children of a triangle lie inside it: their areas add up where the number of parts is even, and their common centroid is its own.
#[test]
fn triangles_join_four_by_four() {
    let hierarchy = Hierarchy::of_faces(&[FaceShape::Triangle { n: 12 }], &[1.0; 144]);
    assert_eq!(hierarchy.sizes(), [144, 36, 9, 1]);
    let level = &hierarchy.levels()[0];
    assert!((0..36).all(|parent| level.children(parent).len() == 4));
    // The first upright triangle holds the first three of row 0 and the first of row 1; the inverted one next to it holds three inverted ones and an upright one.
    assert_eq!(level.children(0), [0, 1, 2, 23]);
    assert_eq!(level.children(1), [3, 24, 25, 26]);
    let odd = Hierarchy::of_faces(&[FaceShape::Triangle { n: 7 }], &[1.0; 49]);
    assert_eq!(odd.sizes(), [49, 9, 1]);
    let n_children: Vec<usize> = (0..9).map(|parent| odd.levels()[0].children(parent).len()).collect();
    assert!(
        n_children.iter().all(|&n| n > 0) && n_children.iter().sum::<usize>() == 49,
        "{n_children:?}"
    );
}
