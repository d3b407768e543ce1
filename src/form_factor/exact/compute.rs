//! Form factors by the exact method, all of them or those that a change reaches.

use super::batch::batch_byte;
use super::batches::{Batches, Finer};
use super::method::ExactMethod;
use crate::form_factor::kept::Piece;
use crate::form_factor::{Before, ComputeResult, Computed, FormFactorError, FormFactorMethod, Input, PairCounts};
use crate::matrix::{FormFactors, StorageChoice};
use crate::progress::{Forecast, Progress};

impl FormFactorMethod for ExactMethod {
    fn name(&self) -> &'static str {
        "exact"
    }

    fn working_byte(&self, n_patches: usize) -> u64 {
        batch_byte(n_patches)
    }

    fn compute(&self, input: Input<'_>, storage: StorageChoice, progress: &dyn Progress) -> ComputeResult {
        self.compute_from(input, None, storage, progress)
    }

    /// Keeps the exchange areas of pairs that the change cannot reach (see [`Change`](crate::form_factor::Change)), and computes the others as [`compute`](Self::compute) does.
    ///
    /// A kept entry is the stored one to the last bit. One that is computed anew differs from the result of `compute` by no more than the
    /// neglected border of occluders, since it may be classified on another level. All are computed anew if `before` is not symmetric, as after a repair.
    fn update(
        &self,
        input: Input<'_>,
        before: Before<'_>,
        storage: StorageChoice,
        progress: &dyn Progress,
    ) -> ComputeResult {
        let usable = before.factors.is_symmetric().then_some(before);
        self.compute_from(input, usable, storage, progress)
    }
}

impl ExactMethod {
    /// Returns the forecast cost of form factors, from a sample of at most some seconds; `None` for a mesh without patches.
    pub(in crate::form_factor) fn forecast(&self, input: Input<'_>, progress: &dyn Progress) -> Option<Forecast> {
        Batches::new(self, input, None, progress).forecast(input, true)
    }

    fn compute_from(
        &self,
        input: Input<'_>,
        before: Option<Before<'_>>,
        storage: StorageChoice,
        progress: &dyn Progress,
    ) -> ComputeResult {
        let known = before.map(|before| before.factors);
        begin(input, known, progress);
        let batches = Batches::new(self, input, before, progress);
        if let Some(forecast) = batches.forecast(input, false) {
            progress.forecast(&forecast);
        }
        collect(batches, input.mesh.areas(), known, storage)
    }

    /// Computes those exchange areas again whose error is more than is allowed now.
    pub(super) fn refine(
        &self,
        input: Input<'_>,
        finer: Finer<'_>,
        storage: StorageChoice,
        progress: &dyn Progress,
    ) -> ComputeResult {
        let known = Some(finer.factors);
        begin(input, known, progress);
        let mut batches = Batches::new(self, input, None, progress);
        batches.finer = Some(finer);
        collect(batches, input.mesh.areas(), known, storage)
    }
}

fn begin(input: Input<'_>, known: Option<&FormFactors>, progress: &dyn Progress) {
    let n = input.mesh.n_patches() as u64;
    progress.begin("form factors", n * n.saturating_sub(1) / 2);
    if let Some(known) = known {
        // A rank may compute any batch, and so need stored entries of any rows.
        known.gather_rows();
    }
}

/// Computes all batches, one by one into the matrix: only one batch's entries are held beside it.
fn collect(
    batches: Batches<'_>,
    areas: Vec<f64>,
    known: Option<&FormFactors>,
    storage: StorageChoice,
) -> ComputeResult {
    let progress = batches.progress;
    let mut counts = PairCounts::default();
    let mut is_stopped = false;
    let pieces: Box<dyn Iterator<Item = Piece>> = if progress.ranks().size() == 1 {
        Box::new(batches)
    } else {
        let shared = batches.shared(storage.place.waiting_byte());
        Box::new(shared.map_while(|piece| {
            is_stopped = piece.is_none();
            piece
        }))
    };
    let upper = pieces.flat_map(|piece| {
        counts = counts.plus(piece.counts);
        piece.tiles
    });
    let factors = FormFactors::from_exchange_tiles(areas, upper, storage);
    if is_stopped || progress.is_cancelled() {
        return Err(FormFactorError::Interrupted);
    }
    if let Some(known) = known {
        known.if_readable(()).map_err(crate::matrix::MatrixError::from)?;
    }
    Ok(Computed {
        factors: factors?,
        pairs: Some(counts),
        tolerance_met: counts.tolerance_met(),
    })
}
