//! The later faces that one face sees: whole branches of the tree of faces at once where nothing can occlude them, or one occluder hides all.

use std::ops::Range;

use super::batches::{Batches, FaceView, Known};
use super::table::MIN_PAIRS;
use crate::form_factor::sight::whole_where_grazing;
use crate::visibility::occluders::{Between, Candidate, Closer, OccluderId, OccluderIndex, Outlook, PairVisibility};

/// The later faces that some patches of a face may see.
#[derive(Default)]
pub(super) struct Views {
    /// In ascending order, without the faces that are only counted.
    pub(super) faces: Vec<FaceView>,
    /// The number of later faces of one patch that face one of one patch, all hidden, with no stated error.
    pub(super) n_hidden: usize,
}

/// The number of recent occluders that are tried on other faces first.
const N_CLOSERS: usize = 3;

/// A search for the faces that a face sees.
struct Search<'a> {
    batches: &'a Batches<'a>,
    face: usize,
    from: Outlook<'a>,
    /// The candidates of all nodes on the way from the root, one after the other.
    candidates: Vec<Candidate>,
    /// The last occluder that hid a face comes first.
    closers: [Option<Closer>; N_CLOSERS],
    scratch: Vec<OccluderId>,
    found: Views,
}

impl Batches<'_> {
    /// Searches a face and all later ones that it faces.
    pub(super) fn views_of(&self, f: usize) -> Views {
        if self.progress.is_cancelled() {
            return Views::default();
        }
        let candidates = self.index.as_ref().map_or_else(Vec::new, OccluderIndex::all_candidates);
        let mut search = Search {
            batches: self,
            face: f,
            from: self.outlook(f),
            closers: [None; N_CLOSERS],
            scratch: Vec::new(),
            found: Views::default(),
            candidates,
        };
        let all = 0..search.candidates.len();
        search.below(0, all);
        let mut found = search.found;
        found.faces.sort_unstable_by_key(|view| view.face);
        found
    }

    fn hull(&self, face: usize) -> &[glam::DVec3] {
        &self.patches.faces[face].runs[0].hull
    }

    fn outlook(&self, face: usize) -> Outlook<'_> {
        Outlook {
            corners: self.hull(face),
            measures: &self.measures[face],
        }
    }
}

impl Search<'_> {
    /// Searches the faces below a node of the tree, which `among` the candidates may be hidden by.
    fn below(&mut self, node: usize, among: Range<usize>) {
        let batches = self.batches;
        if batches.tree.is_behind(self.face, node) {
            return;
        }
        let halves = batches.tree.halves(node);
        let begin = self.candidates.len();
        if let Some(index) = &batches.index {
            let to = batches.tree.bounds(node);
            let hides = |closer: &Closer| index.hides_box(*closer, &self.from, to);
            if let Some(k) = self
                .closers
                .iter()
                .position(|closer| closer.as_ref().is_some_and(hides))
            {
                self.closers[..=k].rotate_right(1);
                self.hidden(node);
                return;
            }
            index.narrow(&self.from, to, halves.is_none(), among, &mut self.candidates);
        }
        let own = begin..self.candidates.len();
        match halves {
            Some(halves) if !own.is_empty() => halves.into_iter().for_each(|half| self.below(half, own.clone())),
            _ => {
                for &g in batches.tree.faces(node) {
                    if self.is_seen(g) {
                        self.look(g, own.clone());
                    }
                }
            }
        }
        self.candidates.truncate(begin);
    }

    /// Returns whether a face comes later, and faces this one.
    fn is_seen(&self, g: usize) -> bool {
        g > self.face && self.batches.faces_face(self.face, g)
    }

    /// Adds the faces below a node, all of which are hidden by one occluder.
    fn hidden(&mut self, node: usize) {
        let batches = self.batches;
        for &g in batches.tree.faces(node) {
            if !self.is_seen(g) {
                continue;
            }
            let is_certain = !batches.progress.is_late() && self.from.faces_clearly(&batches.outlook(g));
            if is_certain && batches.before.is_none() && batches.patches.are_one_pair([self.face, g]) {
                self.found.n_hidden += 1;
            } else {
                self.push(g, |search| {
                    if is_certain {
                        Between::certain(PairVisibility::None)
                    } else {
                        batches.between(batches.hull(search.face), batches.hull(g), None)
                    }
                });
            }
        }
    }

    /// Classifies one face against all of its possible occluders.
    fn look(&mut self, g: usize, among: Range<usize>) {
        let batches = self.batches;
        self.push(g, |search| {
            let Some(index) = batches.index.as_ref().filter(|_| !batches.progress.is_late()) else {
                return batches.between(batches.hull(search.face), batches.hull(g), None);
            };
            let to = batches.outlook(g);
            let (found, closer) = index.between_candidates(
                &search.from,
                &to,
                &search.candidates[among],
                search.closers[0],
                &mut search.scratch,
            );
            if closer.is_some() && closer != search.closers[0] {
                let known = search.closers.iter().position(|&known| known == closer);
                search.closers[..=known.unwrap_or(N_CLOSERS - 1)].rotate_right(1);
                search.closers[0] = closer;
            }
            Between {
                visibility: whole_where_grazing(index, found.visibility, search.from.corners, to.corners),
                ..found
            }
        });
    }

    /// Adds a face, with its occluders in `between`.
    fn push(&mut self, g: usize, between: impl FnOnce(&mut Self) -> Between) {
        let (batches, f) = (self.batches, self.face);
        let known = if !batches.any_moved([f, g]) && batches.is_kept(batches.hull(f), batches.hull(g)) {
            Known::Kept
        } else {
            Known::Seen(between(self))
        };
        let [own, other] = [f, g].map(|k| batches.patches.faces[k].range());
        let fronts = (own.len() * other.len() >= MIN_PAIRS).then(|| {
            [
                batches.facing.in_front(other.clone(), own.clone()),
                batches.facing.in_front(own, other),
            ]
        });
        self.found.faces.push(FaceView { face: g, known, fronts });
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use glam::{DQuat, DVec3};

    use super::*;
    use crate::form_factor::{ExactMethod, Input};
    use crate::geometry::sampling::Random;
    use crate::mesh::{Mesh, Subdivision};
    use crate::progress::Silent;
    use crate::scene::{Corners, Face, Material, MaterialId, Scene, Surface, SurfaceId};
    use crate::visibility::embree::EmbreeVisibility;

    fn cuboid(low: DVec3, size: DVec3, turn: DQuat) -> Vec<Vec<DVec3>> {
        let middle = low + 0.5 * size;
        let at = |k: usize| {
            let pick = DVec3::new((k & 1) as f64, (k >> 1 & 1) as f64, (k >> 2 & 1) as f64);
            middle + turn * (low + pick * size - middle)
        };
        let sides = [
            [0, 4, 6, 2],
            [1, 3, 7, 5],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 2, 3, 1],
            [4, 5, 7, 6],
        ];
        sides.iter().map(|side| side.iter().map(|&k| at(k)).collect()).collect()
    }

    fn cut(quad: &[DVec3], n: u32) -> Vec<Vec<DVec3>> {
        let at = |i: u32, j: u32| {
            let (s, t) = (f64::from(i) / f64::from(n), f64::from(j) / f64::from(n));
            quad[0].lerp(quad[1], s).lerp(quad[3].lerp(quad[2], s), t)
        };
        let cells = (0..n * n).map(|k| (k % n, k / n));
        cells
            .map(|(i, j)| vec![at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)])
            .collect()
    }

    /// Solids that touch or pierce each other, slivers, sheets and turned facets, perhaps in a room; some cracked, cut, bent, or with vertices of their own for each face.
    fn careless(seed: u64) -> Scene {
        let random = &mut Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15));
        let turn = if seed.is_multiple_of(3) {
            DQuat::IDENTITY
        } else {
            DQuat::from_euler(glam::EulerRot::XYZ, random.unit(), random.unit(), random.unit())
        };
        let mut faces: Vec<Vec<DVec3>> = Vec::new();
        if random.is(0.6) {
            let mut room = cuboid(DVec3::ZERO, DVec3::new(4.0, 3.0, 2.0), DQuat::IDENTITY);
            for side in &mut room {
                side.reverse();
            }
            let n = 1 + u32::from(random.is(0.5)) * 3;
            faces.extend(room.iter().flat_map(|side| cut(side, n)));
        }
        let mut low = DVec3::new(0.5, 0.5, 0.0);
        for _ in 0..3 {
            let size = 0.3 + random.point();
            let own = if random.is(0.3) {
                DQuat::from_rotation_z(random.unit())
            } else {
                DQuat::IDENTITY
            };
            let mut solid = cuboid(low, size, own);
            if random.is(0.2) {
                solid[2].reverse();
            }
            if random.is(0.2) {
                solid.remove(1);
            }
            let n = 1 + u32::from(random.is(0.4)) * 2;
            faces.extend(solid.iter().flat_map(|side| cut(side, n)));
            // The next one touches, pierces or stands off.
            low += DVec3::X * size.x * if random.is(0.4) { 1.0 } else { 0.5 + random.unit() };
        }
        for _ in 0..6 {
            let (at, along) = (4.0 * random.point(), random.point() - 0.5);
            let thin = 10.0_f64.powf(-6.0 * random.unit());
            let triangle = vec![at, at + along, at + 0.5 * along + thin * (random.point() - 0.5)];
            faces.push(triangle.clone());
            if random.is(0.5) {
                faces.push(triangle.into_iter().rev().collect());
            }
        }
        scene_of(&faces, turn, random)
    }

    /// Puts faces together, turned; bent, cracked or parted by chance.
    fn scene_of(faces: &[Vec<DVec3>], turn: DQuat, random: &mut Random) -> Scene {
        let (bent, cracked) = (random.is(0.3), random.is(0.3));
        let mut scene = Scene {
            surfaces: vec![Surface { name: "all".into() }],
            materials: vec![Material {
                name: "grey".into(),
                reflectance: [0.5; 3],
                exitance: [0.0; 3],
            }],
            ..Scene::default()
        };
        let own_vertices = random.is(0.4);
        for face in faces {
            let mut off = || {
                let bend = if bent { 1e-7 } else { 0.0 };
                let crack = if cracked && random.is(0.05) { 1e-3 } else { 0.0 };
                (bend + crack) * (random.point() - 0.5)
            };
            let ids: Vec<u32> = face
                .iter()
                .map(|&at| {
                    let corner = turn * at + off();
                    let known = scene.vertices.iter().position(|&v| v == corner && !own_vertices);
                    let index = known.unwrap_or_else(|| {
                        scene.vertices.push(corner);
                        scene.vertices.len() - 1
                    });
                    u32::try_from(index).unwrap()
                })
                .collect();
            scene.faces.push(Face {
                corners: match *ids {
                    [a, b, c] => Corners::Triangle([a, b, c]),
                    _ => Corners::Quad([ids[0], ids[1], ids[2], ids[3]]),
                },
                surface: SurfaceId(0),
                material: MaterialId(0),
                line: 0,
            });
        }
        scene
    }

    /// How many pairs of faces are of each class.
    #[derive(Debug, Default)]
    struct Counted {
        full: usize,
        hidden: usize,
        partial: usize,
        /// The number hidden by a solid, of which the search at one section of each shaft is not sure.
        hidden_surely: usize,
        n_counted_alone: usize,
        /// The number with fewer occluders than a shaft finds.
        n_sharper: usize,
    }

    /// Returns whether a convex polygon crosses some of the segments between two others by more than rounding.
    fn is_between(p: &[DVec3], q: &[DVec3], occluder: &[DVec3]) -> bool {
        let plane = crate::visibility::plane::Plane::of(occluder);
        let point = |corners: &[DVec3], k: usize| {
            let weights: Vec<f64> = (0..corners.len())
                .map(|c| ((k * 7 + c * 13) % 17) as f64 + 0.1)
                .collect();
            let sum = corners.iter().zip(&weights).map(|(&v, &w)| v * w).sum::<DVec3>();
            sum / weights.iter().sum::<f64>()
        };
        (0..17 * 17).any(|k| {
            let (a, b) = (point(p, k % 17), point(q, k / 17));
            let (from, to) = (plane.height(a), plane.height(b));
            if from * to >= 0.0 || from.abs().min(to.abs()) < 1e-9 {
                return false;
            }
            let at = a + (b - a) * (from / (from - to));
            (0..occluder.len()).all(|c| {
                let (start, end) = (occluder[c], occluder[(c + 1) % occluder.len()]);
                plane.normal.cross(end - start).normalize_or_zero().dot(at - start) > 1e-9
            })
        })
    }

    fn compare(batches: &Batches<'_>, f: usize, counted: &mut Counted) {
        let views = batches.views_of(f);
        assert!(views.faces.is_sorted_by_key(|view| view.face));
        let mut n_hidden = 0;
        for g in f + 1..batches.patches.faces.len() {
            let found = views.faces.binary_search_by_key(&g, |view| view.face);
            if !batches.faces_face(f, g) {
                assert!(found.is_err(), "{f} {g}");
                continue;
            }
            let direct = batches.between(batches.hull(f), batches.hull(g), None);
            let known = found.ok().map(|k| &views.faces[k].known);
            let seen = match known {
                Some(Known::Seen(seen)) => seen.clone(),
                Some(Known::Kept) => panic!("nothing is kept"),
                None => {
                    n_hidden += 1;
                    Between::certain(PairVisibility::None)
                }
            };
            match (&direct.visibility, &seen.visibility) {
                (PairVisibility::Partial(_), PairVisibility::None) => counted.hidden_surely += 1,
                (PairVisibility::None, PairVisibility::None) => {
                    counted.hidden += 1;
                    assert!(direct.touched || !seen.touched, "{f} {g}");
                }
                _ if direct == seen => {}
                // The shaft of a sliver has no reliable sides, and counts occluders beside it too.
                (PairVisibility::Partial(all), PairVisibility::Partial(_) | PairVisibility::Full) => {
                    counted.n_sharper += 1;
                    let left = match &seen.visibility {
                        PairVisibility::Partial(some) => some.as_slice(),
                        _ => &[],
                    };
                    assert!(left.iter().all(|id| all.contains(id)), "{f} {g}: {direct:?} {seen:?}");
                    for id in all.iter().filter(|id| !left.contains(id)) {
                        let occluder = batches.index.as_ref().unwrap().corners(*id);
                        assert!(
                            !is_between(batches.hull(f), batches.hull(g), occluder),
                            "{f} {g}: {id:?}"
                        );
                    }
                }
                _ => {
                    assert_eq!(direct.visibility, seen.visibility, "{f} {g}");
                    assert!(direct.touched, "{f} {g}: {direct:?} {seen:?}");
                    counted.n_sharper += 1;
                }
            }
            counted.full += usize::from(seen.visibility == PairVisibility::Full);
            counted.partial += usize::from(matches!(seen.visibility, PairVisibility::Partial(_)));
        }
        assert_eq!(n_hidden, views.n_hidden, "{f}");
        counted.n_counted_alone += n_hidden;
    }

    #[test]
    fn branches_of_the_tree_are_of_the_class_that_each_pair_has_by_itself() {
        let method = ExactMethod::default();
        let mut counted = Counted::default();
        for seed in 0..60 {
            let scene = careless(seed);
            let mesh = Mesh::new(&scene, Subdivision::Uniform(1)).unwrap();
            let visibility = EmbreeVisibility::new(&scene).unwrap();
            let input = Input {
                scene: &scene,
                mesh: &mesh,
                visibility: &visibility,
                unoccluded: false,
            };
            let batches = Batches::new(&method, input, None, &Silent);
            (0..batches.patches.faces.len()).for_each(|f| compare(&batches, f, &mut counted));
        }
        let n_pairs = counted.full + counted.hidden + counted.partial;
        assert!(
            counted.full.min(counted.hidden).min(counted.partial) > 5000 && counted.n_counted_alone > 100,
            "{counted:?}"
        );
        assert!(
            counted.hidden_surely.max(counted.n_sharper) < n_pairs / 100,
            "{counted:?}"
        );
    }
}
