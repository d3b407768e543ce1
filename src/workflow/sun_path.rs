//! Light and heat along a path of the sun: form factors are computed once, and the times are solved side by side in blocks, each stored in the checkpoint.

use rand_pcg::Pcg64Dxsm;
use rand_pcg::rand_core::Rng as _;
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use sha2::{Digest as _, Sha256};

use super::{Context, FormFactorStudy, Leak, Model, SolveRequest, TotalError, Warning, WorkflowError, storage};
use crate::audit::{Audit, Check};
use crate::checkpoint::Checkpoint;
use crate::heat::{SunOccluders, SunPath, SunStep};
use crate::matrix::operator::{Block, LinearOperator as _};
use crate::progress::Progress as _;
use crate::report::series::SeriesBlock;

/// The part of the checkpoint that holds the blocks of a path.
const PART: u32 = 1 << 22;

/// The greatest number of elements in a vector of all unknowns of a block, and the greatest number of times in it.
const BLOCK_SIZE: usize = 1 << 20;
const MAX_STEPS: usize = 64;

/// Receives the values of all patches, block by block.
pub type BlockSink<'a> = &'a mut dyn FnMut(&SeriesBlock) -> Result<(), WorkflowError>;

/// The results of a path of the sun.
#[derive(Clone, Debug)]
pub struct PathStudy<S> {
    /// The result at each time.
    pub steps: Vec<S>,
    /// The solver of the first block: the requested one, or the choice of `auto`.
    pub solver: String,
    /// The number of passes over the form factors, in all blocks.
    pub n_passes: usize,
    /// The worst error of a time by solver and form factors.
    pub error: TotalError,
    /// The number of times that an earlier run had finished.
    pub n_resumed: usize,
}

/// The results of a block, as they are in a checkpoint.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct SolvedBlock<S> {
    pub(super) steps: Vec<S>,
    pub(super) solver: String,
    pub(super) n_passes: usize,
    pub(super) error: TotalError,
    pub(super) values: SeriesBlock,
    pub(super) checks: Vec<Check>,
    pub(super) leak: Option<Leak>,
    pub(super) leak_is_too_great: bool,
    pub(super) warnings: Vec<Warning>,
}

/// The quantities computed at each time of a path.
pub(super) trait PathWork {
    /// The result at a time.
    type Step: Serialize + DeserializeOwned;

    /// The name of the work, and of its stage.
    const NAME: &'static str;

    /// Returns the number of unknowns of one time.
    fn size(&self, model: &Model) -> usize;

    /// Adds the input of the results to a hash, except scene, form factors and path.
    fn hash_into(&self, model: &Model, hasher: &mut Sha256);

    /// Drops the results of single surfaces.
    fn drop_surfaces(step: &mut Self::Step);

    /// Solves for some times; `with_values` includes the values of all patches.
    fn solve(
        &self,
        model: &mut Model,
        occluders: &SunOccluders,
        steps: &[SunStep],
        with_values: bool,
        cx: &mut Context,
    ) -> Result<SolvedBlock<Self::Step>, WorkflowError>;
}

impl Model {
    /// Computes a path of the sun block by block; blocks in the checkpoint are read from it.
    pub(super) fn along<W: PathWork>(
        &mut self,
        study: &FormFactorStudy,
        path: &SunPath,
        (work, request): (&W, &SolveRequest),
        mut sink: Option<BlockSink<'_>>,
        cx: &mut Context,
    ) -> Result<PathStudy<W::Step>, WorkflowError> {
        if cx.checkpoint().is_none() {
            storage::open_checkpoint(cx, self)?;
        }
        let with_values = sink.is_some();
        let key = self.path_key(study, path, (work, request), with_values);
        let occluders = cx.time("sun", || SunOccluders::new(self.input()));
        let n_at_once = (BLOCK_SIZE / work.size(self).max(1)).clamp(1, MAX_STEPS);
        let mut found = PathStudy {
            steps: Vec::with_capacity(path.steps.len()),
            solver: String::new(),
            n_passes: 0,
            error: TotalError::Relative(0.0),
            n_resumed: 0,
        };
        cx.progress().begin(W::NAME, path.steps.len() as u64);
        cx.warns_once_of_a_kind = true;
        let drops_surfaces = cx.demand.drops_surfaces;
        for (k, steps) in path.steps.chunks(n_at_once).enumerate() {
            let kept = cx
                .checkpoint()
                .and_then(|checkpoint| kept_block(checkpoint, &key, k as u64));
            let is_kept = kept.is_some();
            let block = match kept {
                Some(block) => {
                    found.n_resumed += steps.len();
                    block.warnings.iter().for_each(|warning| cx.warn(warning.clone()));
                    block
                }
                None => fresh_block(self, (work, &occluders), steps, with_values, cx)?,
            };
            if let Some(checkpoint) = cx.checkpoint().filter(|_| !is_kept) {
                keep_block(checkpoint, &key, k as u64, &block);
            }
            if let Some(sink) = &mut sink {
                sink(&block.values)?;
            }
            cx.audited(Audit {
                checks: block.checks,
                not_checked: Vec::new(),
            });
            cx.audit.keep_worst();
            cx.leaks.add(block.leak, block.leak_is_too_great);
            found.steps.extend(block.steps.into_iter().map(|mut step| {
                if drops_surfaces {
                    W::drop_surfaces(&mut step);
                }
                step
            }));
            found.n_passes += block.n_passes;
            found.error = found.error.or_worse(block.error);
            if k == 0 {
                found.solver = block.solver;
            }
            cx.progress().advance(steps.len() as u64);
            cx.go_on()?;
        }
        cx.warns_once_of_a_kind = false;
        cx.warn_of_checkpoint();
        Ok(found)
    }

    /// Returns a hash of the input of the results along a path.
    fn path_key<W: PathWork>(
        &self,
        study: &FormFactorStudy,
        path: &SunPath,
        (work, request): (&W, &SolveRequest),
        with_values: bool,
    ) -> [u8; 32] {
        let mut hasher = Sha256::new();
        hasher.update(format!(
            "path 2 {} {with_values} {request:?} {:?};",
            W::NAME,
            path.steps
        ));
        hasher.update(self.scene.content_hash());
        let (reflectance, exitance) = self.materials();
        // Row sums do not suffice: those of all enclosures are 1.
        let n = study.factors.n_rows();
        let mut random = Pcg64Dxsm::new(0, 0);
        let probe = (0..n).map(|_| random.next_u64() as f64 / u64::MAX as f64).collect();
        let mut product = Block::from_values(vec![0.0; n], 1);
        study.factors.apply(&Block::from_values(probe, 1), &mut product);
        for block in [&reflectance, &exitance, &product] {
            hash_block(&mut hasher, block);
        }
        work.hash_into(self, &mut hasher);
        hasher.finalize().into()
    }
}

/// Solves a block, with its own checks.
fn fresh_block<W: PathWork>(
    model: &mut Model,
    (work, occluders): (&W, &SunOccluders),
    steps: &[SunStep],
    with_values: bool,
    cx: &mut Context,
) -> Result<SolvedBlock<W::Step>, WorkflowError> {
    let before = std::mem::take(&mut cx.audit);
    let leaked = std::mem::take(&mut cx.leaks.are_too_great);
    let leak = std::mem::take(&mut cx.leaks.worst);
    let n_warnings = cx.warnings().len();
    let solved = work.solve(model, occluders, steps, with_values, cx);
    let own = std::mem::replace(&mut cx.audit, before);
    let leak_is_too_great = std::mem::replace(&mut cx.leaks.are_too_great, leaked);
    let leak = std::mem::replace(&mut cx.leaks.worst, leak);
    let mut block = solved?;
    // The checks that are left out are the same in all blocks.
    if cx.audit.not_checked.is_empty() {
        cx.audit.not_checked = own.not_checked;
    }
    block.checks = own.checks;
    block.leak = leak;
    block.leak_is_too_great = leak_is_too_great;
    block.warnings = cx.warnings().split_off(n_warnings);
    Ok(block)
}

/// Returns a block that an earlier run has finished.
fn kept_block<S: DeserializeOwned>(checkpoint: &Checkpoint, key: &[u8; 32], k: u64) -> Option<SolvedBlock<S>> {
    checkpoint.begin_part(PART, key);
    ciborium::from_reader(&checkpoint.piece(k)?[..]).ok()
}

/// Stores a block for a later run.
fn keep_block<S: Serialize>(checkpoint: &Checkpoint, key: &[u8; 32], k: u64, block: &SolvedBlock<S>) {
    checkpoint.begin_part(PART, key);
    let mut record = Vec::new();
    // Writing to memory cannot fail, and a block that is not stored is computed again.
    if ciborium::into_writer(block, &mut record).is_ok() {
        checkpoint.keep(k, &record);
    }
}

/// Adds the numbers of a block to a hash.
pub(super) fn hash_block(hasher: &mut Sha256, block: &Block) {
    for value in block.values() {
        hasher.update(value.to_le_bytes());
    }
}
