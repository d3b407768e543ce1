//! Draws the shadow rays of an image again: their end points follow from the file's settings and seed.

use glam::DVec3;

use super::clear_view::Plate;
use super::size::Size;
use super::tolerance::{LEAK, divergence, effective_samples};
use crate::geometry::sampling::{PointStream, Sequence};
use crate::render::attributes::SurfaceRecord;
use crate::render::attributes::{Attributes, PolygonRecord};
use crate::render::direct::{DirectMethod, Target, away_from_edges};
use crate::render::samples::PixelSamples;

/// The distance, as a share of the scene's size, at which a ray in f32 (6e-8) may pass an occluder's edge on either side.
const SHIFT: f64 = 1e-6;

/// The data to draw the rays of [`DirectMethod::Polygons`] again.
pub(super) struct ShadowRays {
    n: u32,
    /// The effective number of independent rays.
    n_effective: f64,
    sequence: Sequence,
    seed: u64,
    /// The height above their faces at which rays start and end, in m.
    offset: f64,
    /// The greatest distance of a ray from its intended line, in m.
    margin: f64,
    /// The number of streams of one pixel.
    n_streams: u64,
    targets: Vec<Target>,
}

/// A point from which rays start.
#[derive(Clone, Copy)]
pub(super) struct Start<'a> {
    pub(super) point: DVec3,
    pub(super) normal: DVec3,
    /// The face that the point is on.
    pub(super) face: &'a [DVec3],
    /// The number of the point's random stream.
    pub(super) stream: u64,
    /// The number of emitters to which rays went before.
    pub(super) n_before: u64,
}

/// The visible fraction of an emitter that one point's rays find.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Fraction {
    /// The least and the greatest value: rays near an edge, whose hit depends on rounding, count as occluded and as visible.
    pub(super) range: [f64; 2],
    /// The stated variance; `None` where rounding decides.
    pub(super) variance: Option<f64>,
    /// Its bias as a ratio of two means, to leading order, without its sign.
    pub(super) bias: f64,
    /// The number x such that rays to a face with the true visible fraction find this or worse with a probability of at most exp(−x).
    pub(super) odds: f64,
}

/// Whether a ray meets an occluder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Meets {
    No,
    /// It depends on rounding.
    Maybe,
    Yes,
}

impl ShadowRays {
    /// Prepares the rays; returns `None` if other rays find the direct light, or if emitters of several surfaces share a stream.
    ///
    /// The file does not contain the order of such emitters. Faces may be bent by up to `touching`, m, so that a ray meets them elsewhere.
    pub(super) fn new(attributes: &Attributes, size: &Size, touching: f64) -> Option<Self> {
        let DirectMethod::Polygons { n } = attributes.render.direct else {
            return None;
        };
        let emits = |surface: &&SurfaceRecord| surface.polygons.iter().any(PolygonRecord::emits);
        let mut emitting = attributes.surfaces.iter().filter(emits);
        let (own, None) = (emitting.next()?, emitting.next()) else {
            return None;
        };
        let offset = attributes.ray_offset;
        let faces = || own.polygons.iter().filter(|polygon| polygon.emits());
        if faces().any(|face| !(3..=4).contains(&face.corners.len())) {
            return None;
        }
        Some(Self {
            n: n.get(),
            n_effective: effective_samples(n.get(), attributes.render.sequence),
            sequence: attributes.render.sequence,
            seed: attributes.render.seed,
            offset,
            margin: SHIFT * size.extent + size.rounding() + touching,
            n_streams: PixelSamples::new(&attributes.render, &attributes.view).n_streams(),
            targets: faces().map(|face| Target::new(face.corners.clone(), offset)).collect(),
        })
    }

    /// Returns the number of rays to each emitter.
    pub(super) fn n(&self) -> f64 {
        f64::from(self.n)
    }

    /// Returns the number of the stream of a pixel's sample.
    pub(super) fn stream(&self, pixel: usize, sample: usize) -> u64 {
        pixel as u64 * self.n_streams + sample as u64
    }

    /// Returns the visible fraction of emitter `k` found by the rays of a point, given the true one.
    pub(super) fn fraction(&self, k: usize, start: &Start<'_>, occluders: &[&Plate], exact: f64) -> Fraction {
        let &Start { point, normal, .. } = start;
        let target = &self.targets[k];
        let mut stream = PointStream::new(self.sequence, self.seed, start.stream);
        stream.skip(start.n_before * u64::from(self.n));
        let foot = away_from_edges(start.face, point, self.offset);
        // Rounding decides which of two faces contains a point on their common edge.
        let margin = self.margin + (foot - point).length();
        let origin = foot + normal * self.offset;
        let mut sums = Sums::default();
        for _ in 0..self.n {
            let (to, weight) = target.next_end(&mut stream, point, normal);
            if weight > 0.0 {
                let met = first_met(origin, to + target.normal * self.offset, occluders, margin);
                sums.add(weight, met, exact);
            }
        }
        if sums.total <= 0.0 {
            // All points are below the horizon, but a part of the face is above it.
            let to = target.middle_above(point, normal);
            sums.add(
                1.0,
                first_met(origin, to + target.normal * self.offset, occluders, margin),
                exact,
            );
        }
        sums.fraction(exact, self.n_effective)
    }
}

/// Sums over the rays to one emitter.
#[derive(Default)]
struct Sums {
    total: f64,
    greatest: f64,
    n: f64,
    arrived: f64,
    undecided: f64,
    /// The sums Σ w² v and Σ w².
    squares: [f64; 2],
    /// The sum Σ w² (v − V), V the true fraction.
    skew: f64,
}

impl Sums {
    fn add(&mut self, weight: f64, met: Meets, exact: f64) {
        let arrives = f64::from(u8::from(met == Meets::No));
        self.total += weight;
        self.greatest = self.greatest.max(weight);
        self.n += 1.0;
        self.arrived += weight * arrives;
        if met == Meets::Maybe {
            self.undecided += weight;
        }
        self.squares[0] += weight * weight * arrives;
        self.squares[1] += weight * weight;
        self.skew += weight * weight * (arrives - exact);
    }

    /// Returns the visible fraction that the rays find.
    ///
    /// With weights w ≤ κ E\[w\] and n independent rays, a fraction Q beyond V means Σ w (v − Q) ≥ 0, where w (v − Q) lies in \[−κ Q, κ (1 − Q)\] E\[w\] and its mean is (V − Q) E\[w\]: the
    /// probability is exp(−n KL(Q ‖ Q − (Q − V)/κ)) at most ([`HOEFFDING_1963`](crate::references::HOEFFDING_1963), theorem 1), and the same below V.
    /// Departures: κ is that of the points drawn; n is the [effective](effective_samples) number of rays.
    fn fraction(&self, exact: f64, n_effective: f64) -> Fraction {
        let fraction = self.arrived / self.total;
        let range = [fraction, (self.arrived + self.undecided) / self.total];
        // The truth is 0 or 1, up to rounding.
        let truth = exact.clamp(LEAK, 1.0 - LEAK);
        let nearest = truth.clamp(range[0], range[1]);
        let evenness = self.total / (self.n * self.greatest);
        let odds = n_effective * divergence(nearest, nearest - (nearest - truth) * evenness);
        let squares = self.squares[0] * (1.0 - 2.0 * fraction) + self.squares[1] * fraction * fraction;
        let of_total = 1.0 / (self.total * self.total);
        Fraction {
            range,
            variance: (self.undecided <= 0.0).then_some(squares.max(0.0) * of_total),
            bias: self.skew.abs() * of_total,
            odds,
        }
    }
}

/// Returns whether a segment between two points meets any of the occluders.
fn first_met(from: DVec3, to: DVec3, occluders: &[&Plate], margin: f64) -> Meets {
    let mut found = Meets::No;
    for occluder in occluders {
        match meets(from, to, occluder, margin) {
            Meets::Yes => return Meets::Yes,
            Meets::Maybe => found = Meets::Maybe,
            Meets::No => {}
        }
    }
    found
}

fn meets(from: DVec3, to: DVec3, occluder: &Plate, margin: f64) -> Meets {
    let [a, b] = [from, to].map(|end| occluder.normal.dot(end - occluder.corners[0]));
    if (a > margin && b > margin) || (a < -margin && b < -margin) {
        return Meets::No;
    }
    // In the plane the hit point moves by more than the ray does, the more oblique the ray is.
    let aslant = (to - from).length() / (a - b).abs();
    if !aslant.is_finite() {
        return Meets::Maybe;
    }
    let place = from + (to - from) * (a / (a - b)).clamp(0.0, 1.0);
    let inside = occluder.depth(place);
    let room = margin * aslant;
    if inside < -room {
        Meets::No
    } else if inside > room && a.abs() > margin && b.abs() > margin {
        Meets::Yes
    } else {
        Meets::Maybe
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_meet_what_they_do_not_graze() {
        let plate = Plate::new(vec![DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y]);
        let through = |x: f64, z: f64| {
            let from = DVec3::new(x, 0.5, 1.0);
            meets(from, DVec3::new(x, 0.5, z), &plate, 1e-6)
        };
        for (x, z, expected) in [
            (0.5, -1.0, Meets::Yes),
            (1.5, -1.0, Meets::No),
            (0.5, 0.1, Meets::No),
            (1.0 - 1e-7, -1.0, Meets::Maybe),
            (1.0 + 1e-7, -1.0, Meets::Maybe),
            (1.0 - 1e-5, -1.0, Meets::Yes),
            (1.0 + 1e-5, -1.0, Meets::No),
            (0.5, 1e-7, Meets::Maybe),
        ] {
            assert_eq!(through(x, z), expected, "{x} {z}");
        }
        // Along the plane, inside and beside.
        let along = |y: f64| meets(DVec3::new(-1.0, y, 0.0), DVec3::new(2.0, y, 0.0), &plate, 1e-6);
        assert_eq!(along(0.5), Meets::Maybe);
    }

    #[test]
    fn sums_give_the_ratio_its_variance_and_its_range() {
        let mut sums = Sums::default();
        for (weight, met) in [(1.0, Meets::Yes), (3.0, Meets::No)] {
            sums.add(weight, met, 0.75);
        }
        let found = sums.fraction(0.75, 2.0);
        assert_eq!(found.range.map(f64::to_bits), [0.75_f64.to_bits(); 2]);
        // Σ w² (v − 3/4)² / 16 = (9/16 + 9/16) / 16, and Σ w² (v − 3/4) / 16 = (9/4 − 3/4) / 16.
        let variance = found.variance.unwrap_or_default();
        assert!((variance - 9.0 / 128.0).abs() < 1e-15 && (found.bias - 1.5 / 16.0).abs() < 1e-15);
        sums.add(4.0, Meets::Maybe, 0.75);
        let wider = sums.fraction(0.75, 3.0);
        assert_eq!(wider.range.map(f64::to_bits), [0.375_f64, 0.875].map(f64::to_bits));
        assert_eq!(wider.variance, None);
        // The truth is within its range.
        assert!(wider.odds.abs() < 1e-15, "{wider:?}");
        // Equal weights: eight rays that all arrive from a half visible emitter.
        let mut all = Sums::default();
        (0..8).for_each(|_| all.add(2.0, Meets::No, 0.5));
        let odds = all.fraction(0.5, 8.0).odds;
        assert!((odds - 8.0 * 2f64.ln()).abs() < 1e-12, "{odds}");
    }
}
