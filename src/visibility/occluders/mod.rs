//! Candidate occluders of two patches, found in f64 before any ray is traced.

mod levels;
mod merge;
mod solids;
mod touching;
mod wide;

use std::borrow::Cow;
use std::ops::ControlFlow;

use glam::DVec3;

use super::plane::{MAX_LEAN, Plane};
use super::shaft::Shaft;
use crate::geometry::box_pairs::BoxTree;
use crate::scene::topology::Pieces;
use crate::scene::{FaceId, SLACK_PER_CORNER, Scene};
pub(crate) use levels::are_sides_of_a_sheet;
use levels::{Levels, noise};
pub(crate) use solids::Solid;
pub(crate) use touching::standing_on;
pub(crate) use wide::{Candidate, Closer, Measures, Outlook};

/// Index of an occluder in a [`OccluderIndex`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct OccluderId(pub u32);

/// A convex planar polygon that stops light from both sides.
#[derive(Clone, Debug, PartialEq)]
pub struct Occluder<'a> {
    /// The corners in order, in m.
    pub corners: Cow<'a, [DVec3]>,
    /// True if light that would meet the back has always met the front of another occluder first.
    ///
    /// The polygon is then a side of a closed convex solid, both patches lie outside, and all sides of the solid that the light may meet are among the occluders.
    pub one_sided: bool,
    /// The solid that it is a side of, where that is known.
    pub body: Option<Body<'a>>,
}

/// A closed convex solid with several occluders as sides.
#[derive(Clone, Copy, Debug)]
pub struct Body<'a>(pub(crate) &'a Solid);

impl PartialEq for Body<'_> {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::eq(self.0, other.0)
    }
}

/// The visibility between two patches.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PairVisibility {
    /// Each sees all of the other in front of its plane: no occluder.
    Full,
    /// Hidden: their fronts do not face each other, or one polygon or one convex solid hides all.
    None,
    /// Perhaps partial: these occluders reach into the space between them. Integration may find that they hide all.
    Partial(Vec<OccluderId>),
}

/// The occluders between two polygons, and whether they are certain.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Between {
    pub(crate) visibility: PairVisibility,
    /// True if the result depends on the rounding of coordinates.
    ///
    /// Either an occluder was left out that reaches in between by no more than rounding, or one that hides all leaves a gap by no more.
    pub(crate) touched: bool,
}

impl Between {
    /// Returns a result that does not depend on rounding.
    pub(crate) fn certain(visibility: PairVisibility) -> Self {
        Self {
            visibility,
            touched: false,
        }
    }
}

/// One convex polygon of the index.
#[derive(Clone, Debug)]
struct Entry {
    corners: Vec<DVec3>,
    plane: Plane,
    /// The box around the corners.
    low: DVec3,
    high: DVec3,
    /// The least and the greatest height of a corner over the plane, as a quad may be bent.
    heights: [f64; 2],
    faces: Vec<FaceId>,
    /// The corners of its faces, if there are several and rounding may move them out of the polygon.
    parts: Vec<Vec<DVec3>>,
    solid: Option<u32>,
}

impl Entry {
    /// Returns the position of the polygon, by its faces, relative to the end of a shaft.
    fn levels(&self, end: &[DVec3], slack: f64) -> Levels {
        let found = Levels::of(end, &self.corners, slack);
        // A face in the middle of the polygon that rounding has put beside its plane, equally at all corners, has no gap to the polygon.
        let touches = |part: &Vec<DVec3>| Levels::of(end, part, slack) == Levels::Touching;
        if found == Levels::Gap && self.parts.iter().any(touches) {
            Levels::Touching
        } else {
            found
        }
    }
}

/// The faces of a scene, prepared for finding the occluders between two convex polygons.
///
/// Flat neighbouring faces with a convex union are joined, and coincident faces count once, so that a triangulated or finely cut wall is
/// one occluder. Queries run in f64 through a tree of boxes.
///
/// A query is conservative: [`PairVisibility::Full`] and [`PairVisibility::None`] are proven, up to a tolerance of 1e-10 of the width that the hull of the two polygons
/// has there (and 16 ulps of the coordinates that matter there), below which a face does not count as reaching in between. The tolerance beside a small patch does not grow with the size or the distance of the other.
/// Where the scene's coordinates were rounded, as those of a file with six decimals, two units of their last digit are added (see the source of `Scene::slack`):
/// faces that were meant to touch do not occlude each other, and the two sides of a sheet that rounding has parted do not see each other.
/// Faces that only touch the convex hull of the two polygons (neighbours, walls that they stand on or lie in) are not occluders. Neither are faces in the plane of one of them that
/// computation has moved off it by up to 1e-10 of the smaller one's size, and two patches in one such plane do not see each other; parallel planes bound a gap that was meant, however narrow.
///
/// Source: the shaft of E. A. Haines and J. R. Wallace, "Shaft Culling for Efficient Ray-Traced Radiosity", 1991.
/// Departures: the hull of the two polygons itself, not of their boxes.
#[derive(Clone, Debug)]
pub struct OccluderIndex {
    entries: Vec<Entry>,
    solids: Vec<Solid>,
    tree: BoxTree,
    /// [`Scene::slack`].
    slack: f64,
    /// The least distance of a patch's farthest corner from its middle, in m; 0 where it is unknown.
    least_reach: f64,
}

impl OccluderIndex {
    /// Gathers the faces of a scene. Work: O(n log n) for n faces, and polygons × corners for each convex solid.
    #[must_use]
    pub fn new(scene: &Scene) -> Self {
        let slack = scene.slack();
        let (joined, pieces) = rayon::join(
            || merge::convex_polygons(scene, slack / SLACK_PER_CORNER),
            || Pieces::of(scene),
        );
        let polygons: Vec<(Vec<DVec3>, Vec<FaceId>)> = joined
            .into_iter()
            .map(|(corners, faces)| {
                let positions = corners.iter().map(|&v| scene.vertices[v as usize]).collect();
                (positions, faces.into_iter().map(FaceId).collect())
            })
            .collect();
        let (solids, solid_of_polygon) = solids::find(scene, &pieces, &polygons, slack);
        drop(pieces);
        let all = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let boxes: Vec<(DVec3, DVec3)> = polygons
            .iter()
            .map(|(corners, _)| corners.iter().fold(all, |(l, h), &v| (l.min(v), h.max(v))))
            .collect();
        let entries =
            polygons
                .into_iter()
                .zip(solid_of_polygon)
                .zip(&boxes)
                .map(|(((corners, faces), solid), &(low, high))| Entry {
                    plane: Plane::of(&corners),
                    heights: Plane::of(&corners).heights(&corners),
                    low,
                    high,
                    parts: if slack > 0.0 && faces.len() > 1 {
                        faces.iter().map(|&face| scene.polygon(face)).collect()
                    } else {
                        Vec::new()
                    },
                    corners,
                    faces,
                    solid,
                });
        Self {
            entries: entries.collect(),
            solids,
            tree: BoxTree::new(boxes),
            slack,
            least_reach: 0.0,
        }
    }

    /// Sets the least reach of later queries' polygons: the greatest distance of a corner from their mean, m.
    pub(crate) fn expect_reach(&mut self, reach: f64) {
        self.least_reach = reach;
    }

    /// Returns how far a face may reach in between two others, in m, and still be left out as rounding of coordinates.
    pub(crate) fn slack(&self) -> f64 {
        self.slack
    }

    /// Returns the number of occluders, which are the faces after joining.
    #[must_use]
    pub fn n_occluders(&self) -> usize {
        self.entries.len()
    }

    /// Returns the corners of an occluder.
    #[must_use]
    pub fn corners(&self, occluder: OccluderId) -> &[DVec3] {
        &self.entries[occluder.0 as usize].corners
    }

    /// Returns the faces of an occluder.
    #[must_use]
    pub fn faces(&self, occluder: OccluderId) -> &[FaceId] {
        &self.entries[occluder.0 as usize].faces
    }

    /// Returns the number of the closed convex solid that an occluder is a side of.
    pub(crate) fn solid_of(&self, occluder: OccluderId) -> Option<usize> {
        self.entries[occluder.0 as usize].solid.map(|solid| solid as usize)
    }

    /// Returns whether a point certainly lies outside, for each closed convex solid.
    pub(crate) fn solids_without(&self, point: DVec3) -> Vec<bool> {
        let excludes = |solid: &Solid| solid.excludes(&[point], self.slack);
        self.solids.iter().map(excludes).collect()
    }

    /// Finds the occluders between two convex planar polygons, wound counter-clockwise seen from their fronts.
    ///
    /// [`Full`](PairVisibility::Full) and [`None`](PairVisibility::None) hold for all parts of the polygons too;
    /// otherwise call [`classify_among`](Self::classify_among) for the parts.
    #[must_use]
    pub fn classify(&self, p: &[DVec3], q: &[DVec3]) -> PairVisibility {
        self.between(p, q).visibility
    }

    /// Does the work of [`classify`](Self::classify), and reports whether an occluder was left out for the rounding of coordinates.
    pub(crate) fn between(&self, p: &[DVec3], q: &[DVec3]) -> Between {
        let all = |look_at: &mut dyn FnMut(OccluderId) -> bool, shaft: &Shaft<'_>| {
            let meets = |(low, high)| shaft.may_meet_box(low, high);
            let goes_on = |goes_on| {
                if goes_on {
                    ControlFlow::Continue(())
                } else {
                    ControlFlow::Break(())
                }
            };
            // The search has no result of its own.
            let _ = self.tree.meeting(&meets, &mut |k| goes_on(look_at(OccluderId(k))));
        };
        self.classify_with(p, q, self.slack, all).0
    }

    /// Returns whether two polygons that seem to face each other are two sides of a sheet, which rounded coordinates have parted.
    pub(crate) fn are_sides_of_a_sheet(&self, p: &[DVec3], q: &[DVec3]) -> bool {
        are_sides_of_a_sheet(p, q, self.slack.max(noise([p, q])))
    }

    /// Finds the occluders between two convex polygons among those given.
    ///
    /// It serves parts of two larger polygons, as their occluders are among those of the larger ones.
    #[must_use]
    pub fn classify_among(&self, p: &[DVec3], q: &[DVec3], among: &[OccluderId]) -> PairVisibility {
        self.between_among(p, q, among).visibility
    }

    /// Does the work of [`classify_among`](Self::classify_among), and reports whether an occluder was left out for the rounding of coordinates.
    pub(crate) fn between_among(&self, p: &[DVec3], q: &[DVec3], among: &[OccluderId]) -> Between {
        self.classify_with(p, q, self.slack, each_of(among)).0
    }

    /// Finds the occluders, `among` those of a pair, between two parts of it that no corners of the scene bound.
    ///
    /// Nothing was meant to touch these parts, and nothing is left out for rounding.
    pub(crate) fn classify_cut(&self, p: &[DVec3], q: &[DVec3], among: &[OccluderId]) -> PairVisibility {
        self.classify_no_sheet(p, q, 0.0, each_of(among)).0.visibility
    }

    /// Tests occluders until one certainly hides all, and returns that one; an occluder that reaches in between by less than `slack`, m, is left out.
    fn classify_with(
        &self,
        p: &[DVec3],
        q: &[DVec3],
        slack: f64,
        each: impl FnOnce(&mut dyn FnMut(OccluderId) -> bool, &Shaft<'_>),
    ) -> (Between, Option<Closer>) {
        if self.are_sides_of_a_sheet(p, q) {
            return (Between::certain(PairVisibility::None), None);
        }
        self.classify_no_sheet(p, q, slack, each)
    }

    /// Does the work of [`classify_with`](Self::classify_with) for polygons that are not both sides of a sheet.
    fn classify_no_sheet(
        &self,
        p: &[DVec3],
        q: &[DVec3],
        slack: f64,
        each: impl FnOnce(&mut dyn FnMut(OccluderId) -> bool, &Shaft<'_>),
    ) -> (Between, Option<Closer>) {
        let Some(shaft) = Shaft::new(p, q, slack) else {
            return (Between::certain(PairVisibility::None), None);
        };
        let mut look = Look {
            index: self,
            ends: [p, q],
            shaft: &shaft,
            slack,
            found: Vec::new(),
            closer: None,
            is_closed: false,
            touched: false,
            last_solid: None,
        };
        each(&mut |occluder| look.at(occluder), &shaft);
        let Look {
            mut found,
            closer,
            is_closed,
            touched,
            ..
        } = look;
        if is_closed {
            // A closed pair is open only by what rounding explains.
            let between = Between {
                visibility: PairVisibility::None,
                touched: closer.is_none(),
            };
            return (between, closer);
        }
        let visibility = if found.is_empty() {
            PairVisibility::Full
        } else {
            found.sort_unstable();
            PairVisibility::Partial(found)
        };
        (Between { visibility, touched }, None)
    }

    /// Returns the number of occluders, counting at most three of one convex solid, as many as the visible sides of a box.
    pub(crate) fn count(&self, occluders: &[OccluderId]) -> usize {
        let mut solids: Vec<u32> = occluders
            .iter()
            .filter_map(|&id| self.entries[id.0 as usize].solid)
            .collect();
        let n_single = occluders.len() - solids.len();
        solids.sort_unstable();
        n_single
            + solids
                .chunk_by(|a, b| a == b)
                .map(|sides| sides.len().min(3))
                .sum::<usize>()
    }

    /// Returns two patches as they were meant where rounding has parted them, or one from the other's plane; `None` without signs that they were to meet.
    pub(crate) fn meeting(&self, p: &[DVec3], q: &[DVec3]) -> Option<[Vec<DVec3>; 2]> {
        touching::meeting(p, q, self.slack)
    }

    /// Returns whether any of the [`occluders`](Self::occluders) is moved from its position in the file, because it stands on one of the patches.
    pub(crate) fn any_stands_on(&self, p: &[DVec3], q: &[DVec3], occluders: &[OccluderId]) -> bool {
        let mut corners = occluders.iter().map(|&id| self.corners(id));
        corners.any(|corners| matches!(touching::standing_on([p, q], corners, self.slack), Cow::Owned(_)))
    }

    /// Returns the polygons of the occluders between two patches, as integration needs them.
    ///
    /// Where coordinates are rounded, an occluder that stands on one of the patches, no farther from its plane than rounding explains, is extended through the plane: the slit that rounding may have left under it
    /// is narrower than the accuracy of its position, and takes very many evaluations.
    #[must_use]
    pub fn occluders(&self, p: &[DVec3], q: &[DVec3], occluders: &[OccluderId]) -> Vec<Occluder<'_>> {
        let mut outside: Vec<(u32, bool)> = Vec::new();
        let mut found: Vec<Occluder<'_>> = Vec::with_capacity(occluders.len());
        for id in occluders {
            let entry = &self.entries[id.0 as usize];
            let body = entry.solid.filter(|&index| {
                if let Some(known) = outside.iter().find(|known| known.0 == index) {
                    return known.1;
                }
                let solid = &self.solids[index as usize];
                // A strip of a patch that rounding has put inside sees the sides from behind.
                let excluded = [p, q].iter().all(|end| solid.excludes_all_of(end, self.slack));
                outside.push((index, excluded));
                excluded
            });
            found.push(Occluder {
                corners: touching::standing_on([p, q], &entry.corners, self.slack),
                one_sided: body.is_some(),
                body: body.map(|index| Body(&self.solids[index as usize])),
            });
        }
        // A solid that was moved to stand on a patch, where coordinates are rounded, differs from the file's.
        let moved = found
            .iter()
            .filter(|side| self.slack > 0.0 && matches!(side.corners, Cow::Owned(_)));
        let moved: Vec<Body<'_>> = moved.filter_map(|side| side.body).collect();
        for side in &mut found {
            side.body = side.body.filter(|body| !moved.contains(body));
        }
        found
    }
}

/// A test of the occluders between two polygons, one after the other.
struct Look<'a> {
    index: &'a OccluderIndex,
    ends: [&'a [DVec3]; 2],
    shaft: &'a Shaft<'a>,
    slack: f64,
    found: Vec<OccluderId>,
    /// The occluder that certainly hides all.
    closer: Option<Closer>,
    /// Whether all is hidden, but for light that passes by rounding.
    is_closed: bool,
    /// See [`Between::touched`].
    touched: bool,
    last_solid: Option<u32>,
}

impl Look<'_> {
    /// Tests one more occluder; returns false once no more tests are needed.
    ///
    /// An occluder in the plane of a patch hides nothing from it; one at a gap that was meant hides it, however narrow the gap is.
    fn at(&mut self, occluder: OccluderId) -> bool {
        let (shaft, entry) = (self.shaft, &self.index.entries[occluder.0 as usize]);
        if shaft.is_apart_from(entry.low, entry.high) || !self.meets(entry) {
            return true;
        }
        self.found.push(occluder);
        let is_closed = |slack: f64| shaft.is_closed_by(&entry.corners, &entry.plane, slack);
        if is_closed(self.slack) {
            self.is_closed = true;
            if self.slack <= 0.0 || is_closed(0.0) {
                self.closer = Some(Closer::Polygon(occluder));
            }
        }
        if self.closer.is_none()
            && let Some(solid) = entry.solid
            && self.last_solid != Some(solid)
        {
            self.last_solid = Some(solid);
            let [p, q] = self.ends;
            if self.index.solids[solid as usize].closes(shaft, p, q, self.index.slack) {
                self.is_closed = true;
                self.closer = Some(Closer::Solid(solid));
            }
        }
        self.closer.is_none()
    }

    fn meets(&mut self, entry: &Entry) -> bool {
        let (shaft, slack) = (self.shaft, self.slack);
        if slack <= 0.0 {
            return shaft.meets(&entry.corners) && !self.is_in_plane_of_an_end(entry);
        }
        if !shaft.is_touched_by(&entry.corners) {
            return false;
        }
        let levels = self
            .ends
            .map(|end| entry.levels(end, slack.max(noise([end, &entry.corners]))));
        let is_met =
            !levels.contains(&Levels::Touching) && (levels.contains(&Levels::Gap) || shaft.meets(&entry.corners));
        self.touched |= !is_met;
        is_met
    }

    /// Returns whether a polygon is part of a sheet with one of the ends, but for the rounding of a computation.
    fn is_in_plane_of_an_end(&self, entry: &Entry) -> bool {
        self.ends.iter().any(|end| {
            let noise = noise([end, &entry.corners]);
            entry.plane.height(end[0]).abs() <= noise * (2.0 + MAX_LEAN)
                && Levels::of(end, &entry.corners, noise) == Levels::Touching
        })
    }
}

/// Returns a function that visits some occluders, one after the other.
fn each_of(among: &[OccluderId]) -> impl FnOnce(&mut dyn FnMut(OccluderId) -> bool, &Shaft<'_>) {
    |look_at, _| {
        among.iter().all(|&k| look_at(k));
    }
}
