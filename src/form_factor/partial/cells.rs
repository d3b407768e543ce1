//! Cutting the receiver into convex cells along the discontinuity lines.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use glam::DVec2;

use super::events::Event;

/// A convex part of the receiver and the events that cross it.
struct Cell {
    corners: Vec<DVec2>,
    area: f64,
    /// Indices of events, the one that runs longest through the cell first.
    events: Vec<u32>,
}

/// A domain of one integration.
#[derive(Clone, Copy, Debug)]
pub(super) enum Shape {
    Triangle([DVec2; 3]),
    /// Convex.
    Quad([DVec2; 4]),
}

impl Shape {
    pub(super) fn area(self) -> f64 {
        let twice = match self {
            Self::Triangle([a, b, c]) => (b - a).perp_dot(c - a),
            Self::Quad([a, b, c, d]) => (c - a).perp_dot(d - b),
        };
        0.5 * twice.abs()
    }

    pub(super) fn corners(&self) -> &[DVec2] {
        match self {
            Self::Triangle(corners) => corners,
            Self::Quad(corners) => corners,
        }
    }

    /// Returns the triangles that it is made of.
    pub(super) fn triangles(self) -> impl Iterator<Item = [DVec2; 3]> {
        let (first, second) = match self {
            Self::Triangle(corners) => (corners, None),
            Self::Quad(_) => {
                let [first, second] = self.halves();
                (first, Some(second))
            }
        };
        std::iter::once(first).chain(second)
    }

    /// Cuts a triangle through the middle of its longest side, and a quadrilateral along its shorter diagonal.
    pub(super) fn halves(self) -> [[DVec2; 3]; 2] {
        match self {
            Self::Triangle([a, b, c]) => {
                let [ab, bc, ca] = [a.distance_squared(b), b.distance_squared(c), c.distance_squared(a)];
                let (a, b, c) = if ab >= bc && ab >= ca {
                    (a, b, c)
                } else if bc >= ca {
                    (b, c, a)
                } else {
                    (c, a, b)
                };
                let middle = a.midpoint(b);
                [[a, middle, c], [middle, b, c]]
            }
            Self::Quad([a, b, c, d]) => {
                if b.distance_squared(d) < a.distance_squared(c) {
                    [[a, b, d], [b, c, d]]
                } else {
                    [[a, b, c], [a, c, d]]
                }
            }
        }
    }
}

/// The cells of a receiver.
pub(super) struct Cells {
    corners: Vec<Vec<DVec2>>,
    are_whole: bool,
}

impl Cells {
    /// Cuts a convex polygon along events until none crosses a cell deeper than `margin`, or there are `most` cells.
    ///
    /// Larger cells come first, and a cut runs along the whole line of an event through the cell.
    pub(super) fn cut(corners: Vec<DVec2>, events: &[Event], margin: f64, most: usize) -> Self {
        let all: Vec<u32> = (0..u32::try_from(events.len()).unwrap_or(u32::MAX)).collect();
        let (mut done, mut are_whole) = (Vec::new(), true);
        let mut open = BinaryHeap::from([Cell::new(corners, &all, events, margin)]);
        while let Some(cell) = open.pop() {
            match cell.events.first() {
                Some(&k) if done.len() + open.len() + 1 < most => {
                    let event = &events[k as usize];
                    let left = (event.to - event.from).normalize_or_zero().perp();
                    open.extend([left, -left].map(|inward| {
                        let part = clip(&cell.corners, event.from, inward);
                        Cell::new(part, &cell.events, events, margin)
                    }));
                }
                left => {
                    are_whole &= left.is_none();
                    done.push(cell.corners);
                }
            }
        }
        Self {
            corners: done,
            are_whole,
        }
    }

    /// Returns whether no event is left that crosses a cell.
    pub(super) fn are_whole(&self) -> bool {
        self.are_whole
    }

    /// Iterates over quadrilaterals and triangles that fill the cells.
    pub(super) fn shapes(&self) -> impl Iterator<Item = Shape> + '_ {
        self.corners.iter().flat_map(|c| {
            let n = c.len();
            (1..n.saturating_sub(1)).step_by(2).map(move |k| {
                if k + 2 < n {
                    Shape::Quad([c[0], c[k], c[k + 1], c[k + 2]])
                } else {
                    Shape::Triangle([c[0], c[k], c[k + 1]])
                }
            })
        })
    }
}

impl Cell {
    /// Makes a cell with those of the events `among` that cross it.
    fn new(corners: Vec<DVec2>, among: &[u32], events: &[Event], margin: f64) -> Self {
        let mut crossing: Vec<u32> = Vec::with_capacity(among.len());
        let mut longest = margin;
        for &k in among {
            let length = length_inside(&events[k as usize], &corners, margin);
            if length > margin {
                crossing.push(k);
            }
            if length > longest {
                longest = length;
                let last = crossing.len() - 1;
                crossing.swap(0, last);
            }
        }
        let area = corners
            .windows(2)
            .map(|w| (w[0] - corners[0]).perp_dot(w[1] - corners[0]))
            .sum();
        Self {
            corners,
            area,
            events: crossing,
        }
    }
}

impl PartialEq for Cell {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Cell {}

impl PartialOrd for Cell {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Cell {
    fn cmp(&self, other: &Self) -> Ordering {
        self.area.total_cmp(&other.area)
    }
}

/// Returns the length of the part of an event that lies more than `margin` inside a convex polygon, wound counter-clockwise; 0 in a polygon no larger than `margin`.
fn length_inside(event: &Event, corners: &[DVec2], margin: f64) -> f64 {
    let (mut low, mut high, mut is_speck) = (0.0_f64, 1.0_f64, true);
    let Some(&last) = corners.last() else {
        return 0.0;
    };
    let mut a = last;
    for &b in corners {
        let edge = b - a;
        // Cuts through one point leave edges as short as rounding, whose direction means nothing.
        if edge.length_squared() <= margin * margin {
            continue;
        }
        is_speck = false;
        let inward = edge.perp().normalize();
        let at_0 = inward.dot(event.from - a) - margin;
        let at_1 = inward.dot(event.to - a) - margin;
        a = b;
        if at_0 < 0.0 {
            if at_1 <= 0.0 {
                return 0.0;
            }
            low = low.max(at_0 / (at_0 - at_1));
        } else if at_1 < 0.0 {
            high = high.min(at_0 / (at_0 - at_1));
        }
        if low >= high {
            return 0.0;
        }
    }
    if is_speck {
        return 0.0;
    }
    (high - low) * event.from.distance(event.to)
}

/// Returns the part of a convex polygon on the side of a line that `inward` points to.
fn clip(corners: &[DVec2], point: DVec2, inward: DVec2) -> Vec<DVec2> {
    let mut part = Vec::with_capacity(corners.len() + 1);
    for (k, &a) in corners.iter().enumerate() {
        let b = corners[(k + 1) % corners.len()];
        let (height_a, height_b) = (inward.dot(a - point), inward.dot(b - point));
        if height_a >= 0.0 {
            part.push(a);
        }
        if (height_a >= 0.0) != (height_b >= 0.0) {
            part.push(a + (b - a) * (height_a / (height_a - height_b)));
        }
    }
    part
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: [DVec2; 4] = [
        DVec2::new(0.0, 0.0),
        DVec2::new(1.0, 0.0),
        DVec2::new(1.0, 1.0),
        DVec2::new(0.0, 1.0),
    ];

    fn event(from: (f64, f64), to: (f64, f64)) -> Event {
        Event {
            from: DVec2::from(from),
            to: DVec2::from(to),
        }
    }

    fn areas(cells: &Cells) -> Vec<f64> {
        cells.shapes().map(Shape::area).collect()
    }

    #[test]
    fn cells_fill_the_polygon_and_no_event_crosses_them() {
        let events = [
            event((-1.0, 0.3), (2.0, 0.4)),
            event((0.2, -1.0), (0.9, 2.0)),
            event((0.5, 0.5), (0.7, 0.1)),
            event((0.1, 0.9), (0.15, 0.95)),
        ];
        let cells = Cells::cut(SQUARE.to_vec(), &events, 1e-9, 1000);
        assert!(areas(&cells).iter().all(|&a| a > 0.0));
        assert!((areas(&cells).iter().sum::<f64>() - 1.0).abs() < 1e-14);
        for cell in &cells.corners {
            for e in &events {
                assert!(length_inside(e, cell, 1e-9) < 1e-8);
            }
        }
        assert!(
            cells.corners.len() > 6 && cells.corners.len() < 14,
            "{}",
            cells.corners.len()
        );
    }

    #[test]
    fn events_on_the_border_or_twice_cut_once() {
        let events = [
            event((0.0, 0.0), (1.0, 0.0)),
            event((0.5, 0.0), (0.5, 1.0)),
            event((0.5, 0.2), (0.5, 0.8)),
            event((0.5 + 1e-12, 0.1), (0.5 - 1e-12, 0.9)),
            event((2.0, 0.0), (2.0, 1.0)),
        ];
        assert_eq!(Cells::cut(SQUARE.to_vec(), &events, 1e-9, 1000).corners.len(), 2);
    }

    #[test]
    fn edges_of_no_length_do_not_hide_events() {
        let mut corners = SQUARE.to_vec();
        corners.insert(1, DVec2::new(1.0 - 1e-16, -1e-16));
        corners.insert(3, DVec2::new(1.0 - 1e-16, 1.0 + 2e-16));
        let across = event((0.0, 0.4), (1.0, 0.6));
        for turn in 0..corners.len() {
            corners.rotate_left(turn);
            assert!(length_inside(&across, &corners, 1e-9) > 1.0);
        }
    }

    #[test]
    fn a_speck_of_a_cell_is_not_cut() {
        let across = [event((-1.0, -1.0), (1.0, 1.0))];
        for size in [0.0, 1e-10, 0.9e-9] {
            let speck: Vec<DVec2> = SQUARE.iter().map(|&v| size * v).collect();
            assert_eq!(Cells::cut(speck, &across, 1e-9, 1000).corners.len(), 1, "{size:e}");
        }
        assert!(length_inside(&across[0], &[], 1e-9) <= 0.0);
    }

    #[test]
    fn the_number_of_cells_is_kept_to_and_large_cells_are_cut_first() {
        let events: Vec<Event> = (1..40)
            .map(|k| event((0.0, f64::from(k) / 40.0), (1.0, f64::from(k) / 40.0)))
            .collect();
        let cells = Cells::cut(SQUARE.to_vec(), &events, 1e-9, 10);
        assert_eq!(cells.corners.len(), 10);
        assert!((areas(&cells).iter().sum::<f64>() - 1.0).abs() < 1e-14);
    }
}
