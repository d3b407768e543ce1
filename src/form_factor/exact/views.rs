//! What one face sees of all later ones: whole branches of the tree of faces at once, where nothing can stand in between or one thing hides all.

use std::ops::Range;

use super::batches::{Batches, FaceView, Known};
use super::table::MIN_PAIRS;
use crate::form_factor::sight::whole_where_grazing;
use crate::visibility::occluders::{Between, Candidate, Closer, OccluderId, OccluderIndex, Outlook, PairVisibility};

/// The later faces that some patches of a face may see.
#[derive(Default)]
pub(super) struct Views {
    /// In ascending order; without those that are only counted.
    pub(super) faces: Vec<FaceView>,
    /// Later faces of one patch that face one of one patch, all hidden, for which nothing is stated.
    pub(super) n_hidden: usize,
}

/// So many of those that hid something last are tried on others.
const N_CLOSERS: usize = 3;

/// A search for what a face sees.
struct Search<'a> {
    batches: &'a Batches<'a>,
    face: usize,
    from: Outlook<'a>,
    /// The candidates of all nodes on the way from the root, one after the other.
    candidates: Vec<Candidate>,
    /// What hid something last comes first.
    closers: [Option<Closer>; N_CLOSERS],
    scratch: Vec<OccluderId>,
    found: Views,
}

impl Batches<'_> {
    /// Looks at a face and all later ones that it faces.
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
    /// Looks at the faces below a node of the tree, which `among` the candidates may be hidden by.
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

    /// Tells whether a face comes later, and faces this one.
    fn is_seen(&self, g: usize) -> bool {
        g > self.face && self.batches.faces_face(self.face, g)
    }

    /// Takes the faces below a node, all of which something hides.
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

    /// Looks at one face, with all that may stand in between.
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

    /// Adds a face, of which `between` tells what stands in between.
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
