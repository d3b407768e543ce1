//! The same rays through embree4-rs, which builds its scene and fills Embree's structs by itself.

use embree4_rs::geometry::TriangleMeshGeometry;
use embree4_sys::{RTCBuildQuality, RTCRay, RTCSceneFlags};
use radiosity::scene::Corners;
use radiosity::visibility::embree::EmbreeVisibility;
use radiosity::visibility::{Coherence, HitBatch, RayBatch, Visibility};

use super::scenes::{Random, soup};

#[test]
fn single_rays_through_embree4_rs_hit_the_same_triangles() {
    let mut random = Random::new(30);
    let scene = soup(1000, false, &mut random);
    let visibility = EmbreeVisibility::new(&scene).unwrap();

    let vertices: Vec<(f32, f32, f32)> = scene
        .vertices
        .iter()
        .map(|&v| (v - visibility.frame_origin()).as_vec3().into())
        .collect();
    let triangles: Vec<(u32, u32, u32)> = scene
        .faces
        .iter()
        .map(|face| match face.corners {
            Corners::Triangle(corners) => corners.into(),
            Corners::Quad(_) => panic!("the scene is made of triangles"),
        })
        .collect();
    let device = embree4_rs::Device::try_new(None).unwrap();
    let geometry = TriangleMeshGeometry::try_new(&device, &vertices, &triangles).unwrap();
    let options = embree4_rs::SceneOptions {
        build_quality: RTCBuildQuality::HIGH,
        flags: RTCSceneFlags::ROBUST,
    };
    let reference = embree4_rs::Scene::try_new(device, options).unwrap();
    reference.attach_geometry(&geometry).unwrap();
    let reference = reference.commit().unwrap();

    let mut rays = RayBatch::default();
    for _ in 0..50_000 {
        let (from, to) = (random.direction(), 2.0 * (random.point() - 0.5));
        rays.push_ray(from, to - from);
    }
    let mut hits = HitBatch::default();
    visibility.closest_hits(&rays, Coherence::Incoherent, &mut hits);
    let mut n_hits = 0;
    for k in 0..rays.len() {
        let ray = RTCRay {
            org_x: rays.origin[0][k],
            org_y: rays.origin[1][k],
            org_z: rays.origin[2][k],
            dir_x: rays.direction[0][k],
            dir_y: rays.direction[1][k],
            dir_z: rays.direction[2][k],
            ..RTCRay::default()
        };
        let expected = reference.intersect_1(ray, None).unwrap();
        assert_eq!(hits.face(k).is_some(), expected.is_some(), "ray {k}");
        let (Some(hit), Some(expected)) = (hits.face(k), expected) else {
            continue;
        };
        n_hits += 1;
        assert_eq!(hit.face.0, expected.hit.primID, "ray {k}");
        let normal = [expected.hit.Ng_x, expected.hit.Ng_y, expected.hit.Ng_z];
        let along: f32 = (0..3).map(|axis| normal[axis] * rays.direction[axis][k]).sum();
        assert_eq!(hit.back, along > 0.0, "ray {k}");
        let apart = [
            hits.t[k] - expected.ray.tfar,
            hits.u[k] - expected.hit.u,
            hits.v[k] - expected.hit.v,
        ];
        // Packets and single rays go through different instructions, and round differently.
        assert!(
            apart[0].abs() <= 1e-6 * expected.ray.tfar,
            "ray {k}: t differs by {}",
            apart[0]
        );
        assert!(apart[1].abs() <= 1e-4 && apart[2].abs() <= 1e-4, "ray {k}: {apart:?}");
    }
    assert!(n_hits > 10_000 && n_hits < 40_000, "{n_hits} hits");
}
