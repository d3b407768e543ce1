//! The unfolded view's layout.

use std::collections::BTreeSet;
use std::num::NonZeroU32;

use radiosity::geometry::{DVec3, polygon};
use radiosity::render::{RenderError, Tile, Unfolded};
use radiosity::scene::{FaceId, Scene};

use super::scenes::{Builder, box_scene, box_walls, rectangle};

const BLACK: [[f64; 3]; 6] = [[0.0; 3]; 6];

fn layout(scene: &Scene, n: u32) -> Unfolded {
    Unfolded::new(scene, NonZeroU32::new(n).unwrap()).unwrap()
}

/// Returns the tile's pixel edges: left, top, right, bottom.
fn edges(tile: &Tile) -> [u32; 4] {
    [tile.left, tile.top, tile.left + tile.width, tile.top + tile.height]
}

/// Checks what holds for every layout, and returns the pairs of tiles that touch along an edge, with whether they touch in the scene.
fn joints(scene: &Scene, layout: &Unfolded) -> Vec<(usize, usize, bool)> {
    let mut found = Vec::new();
    for (i, a) in layout.tiles.iter().enumerate() {
        let [left, top, right, bottom] = edges(a);
        assert!(right <= layout.width && bottom <= layout.height);
        let face = scene.faces.iter().position(|face| face.surface == a.surface).unwrap();
        let face = FaceId(u32::try_from(face).unwrap());
        let normal = scene.area_vector(face).normalize();
        assert!((a.normal() - normal).length() < 1e-12, "a tile is not mirrored");
        for (j, b) in layout.tiles.iter().enumerate().skip(i + 1) {
            let other = edges(b);
            let columns = left.max(other[0])..right.min(other[2]);
            let rows = top.max(other[1])..bottom.min(other[3]);
            assert!(
                columns.is_empty() || rows.is_empty(),
                "{} and {} overlap",
                a.name,
                b.name
            );
            let ends = if rows.start == rows.end && !columns.is_empty() {
                [(columns.start, rows.start), (columns.end, rows.start)]
            } else if columns.start == columns.end && !rows.is_empty() {
                [(columns.start, rows.start), (columns.start, rows.end)]
            } else {
                continue;
            };
            let together = ends
                .iter()
                .map(|&(x, y)| (f64::from(x), f64::from(y)))
                .all(|(x, y)| (a.point(x, y) - b.point(x, y)).length() < 1e-9);
            found.push((i, j, together));
        }
    }
    found
}

/// The tile covers the given surface's bounding box exactly.
fn covers(tile: &Tile, scene: &Scene) {
    let points: Vec<DVec3> = scene
        .face_ids()
        .filter(|face| scene.faces[face.0 as usize].surface == tile.surface)
        .flat_map(|face| scene.polygon(face))
        .collect();
    for corner in tile.rectangle() {
        let nearest = points
            .iter()
            .map(|v| (*v - corner).length())
            .fold(f64::INFINITY, f64::min);
        assert!(nearest < 1e-12, "{}: {corner}", tile.name);
    }
}

#[test]
fn a_box_opens_as_a_cross_whose_tiles_touch_as_the_walls_do() {
    let scene = box_scene(DVec3::new(3.0, 2.0, 1.0), BLACK, BLACK);
    let layout = layout(&scene, 30);
    // The floor z0 is the largest wall, first of two; its first edge runs along x.
    let names: Vec<&str> = layout.tiles.iter().map(|tile| tile.name.as_str()).collect();
    assert_eq!(names, ["z0", "x1", "x0", "z1", "y1", "y0"]);
    assert_eq!((layout.width, layout.height), (10 + 30 + 10 + 30, 10 + 20 + 10));
    assert_eq!(edges(&layout.tiles[0]), [10, 10, 40, 30]);
    assert_eq!(edges(&layout.tiles[3]), [50, 10, 80, 30]);
    assert_eq!(edges(&layout.tiles[4]), [10, 0, 40, 10]);
    assert!((layout.tiles[0].right - DVec3::X).length() < 1e-15);
    assert!((layout.tiles[0].down + DVec3::Y).length() < 1e-15);
    for tile in &layout.tiles {
        covers(tile, &scene);
    }
    let joints = joints(&scene, &layout);
    assert_eq!(joints.len(), 5);
    assert!(joints.iter().all(|joint| joint.2), "{joints:?}");
    assert!(layout.left_out.is_empty());
}

#[test]
fn rotated_outward_split_and_open_boxes_open_as_well() {
    let turn = glam::DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.9);
    for outward in [false, true] {
        let mut builder = Builder::default();
        let black = builder.material([0.0; 3], [0.0; 3]);
        for (k, wall) in box_walls(DVec3::new(1.0, 1.0, 0.5))
            .iter()
            .enumerate()
            .filter(|(k, _)| *k != 3)
        {
            let surface = builder.surface(&format!("wall {k}"));
            let mut corners = wall.map(|v| turn * v + DVec3::new(10.0, -3.0, 4.0));
            if outward {
                corners.reverse();
            }
            // Two triangles: the diagonal is the longest edge, but not the side of the smallest rectangle.
            builder.face(surface, black, &[corners[0], corners[1], corners[2]]);
            builder.face(surface, black, &[corners[0], corners[2], corners[3]]);
        }
        let layout = layout(&builder.scene, 16);
        assert_eq!(layout.tiles.len(), 5);
        let joints = joints(&builder.scene, &layout);
        assert_eq!(joints.len(), 4, "outward: {outward}");
        assert!(joints.iter().all(|joint| joint.2), "outward: {outward}");
        for tile in &layout.tiles {
            covers(tile, &builder.scene);
        }
    }
}

#[test]
fn other_surfaces_follow_in_rows_and_curved_ones_are_named() {
    let mut builder = Builder {
        scene: box_scene(DVec3::ONE, BLACK, BLACK),
    };
    let black = builder.material([0.0; 3], [0.0; 3]);
    let lamp = builder.surface("lamp");
    let at = DVec3::new(0.25, 0.25, 0.9);
    builder.face(lamp, black, &rectangle(at, DVec3::Y * 0.5, DVec3::X * 0.25));
    let bent = builder.surface("bent");
    builder.face(bent, black, &rectangle(at * 0.5, DVec3::X * 0.1, DVec3::Y * 0.1));
    builder.face(bent, black, &rectangle(at * 0.5, DVec3::Y * 0.1, DVec3::Z * 0.1));
    let sheet = builder.surface("two-sided");
    builder.face(sheet, black, &rectangle(at * 0.3, DVec3::X * 0.1, DVec3::Y * 0.1));
    builder.face(sheet, black, &rectangle(at * 0.3, DVec3::Y * 0.1, DVec3::X * 0.1));
    let triangle = builder.surface("triangle");
    let c = DVec3::new(0.1, 0.1, 0.5);
    builder.face(triangle, black, &[c, c + DVec3::X * 0.4, c + DVec3::Y * 0.3]);
    builder.surface("empty");

    let layout = layout(&builder.scene, 20);
    assert_eq!(layout.left_out, ["bent", "two-sided"]);
    let names: BTreeSet<&str> = layout.tiles.iter().map(|tile| tile.name.as_str()).collect();
    assert_eq!(
        names,
        BTreeSet::from(["x0", "x1", "y0", "y1", "z0", "z1", "lamp", "triangle"])
    );
    let joints = joints(&builder.scene, &layout);
    assert_eq!(joints.len(), 5, "the cross touches, the others do not");
    let tile = |name: &str| layout.tiles.iter().find(|tile| tile.name == name).unwrap();
    assert_eq!((tile("lamp").width, tile("lamp").height), (10, 5));
    assert!((tile("lamp").right - DVec3::Y).length() < 1e-15, "along its first edge");
    assert_eq!((tile("triangle").width, tile("triangle").height), (8, 6));
    assert!(tile("lamp").top >= 60 && tile("triangle").top >= 60);
    covers(tile("lamp"), &builder.scene);
}

#[test]
fn without_a_box_all_tiles_stand_in_rows() {
    let mut builder = Builder::default();
    let black = builder.material([0.0; 3], [0.0; 3]);
    for k in 0..7 {
        let surface = builder.surface(&format!("s{k}"));
        let c = DVec3::new(2.0 * f64::from(k), 0.0, 0.0);
        builder.face(surface, black, &rectangle(c, DVec3::X, DVec3::Y * (1.0 + f64::from(k))));
    }
    let layout = layout(&builder.scene, 140);
    assert_eq!(layout.tiles.len(), 7);
    assert!(joints(&builder.scene, &layout).is_empty());
    assert_eq!((layout.tiles[0].width, layout.tiles[0].height), (20, 20));
    assert_eq!(layout.tiles[6].height, 140);
    assert!(layout.tiles.iter().any(|tile| tile.top > 0), "more than one row");
    for tile in &layout.tiles {
        covers(tile, &builder.scene);
        let area = polygon::area_vector(&tile.rectangle()).length();
        let pixels = f64::from(tile.width) * f64::from(tile.height);
        assert!((tile.pixel_size[0] * tile.pixel_size[1] * pixels - area).abs() < 1e-12);
    }
}

#[test]
fn scenes_without_flat_surfaces_and_giant_images_are_errors() {
    let one = NonZeroU32::new(1).unwrap();
    assert!(matches!(Unfolded::new(&Scene::default(), one), Err(RenderError::Empty)));
    let scene = box_scene(DVec3::ONE, BLACK, BLACK);
    let error = Unfolded::new(&scene, NonZeroU32::new(1 << 30).unwrap()).unwrap_err();
    assert!(matches!(error, RenderError::TooLarge { width, .. } if width == 4 << 30));
}
