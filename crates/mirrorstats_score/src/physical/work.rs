//! Limits the work of a plan per row, so that small files with a small definition file cannot cause hours of work.

use super::{Kernel, PhysicalPlan, Shape, Step};
use mirrorstats_exact::budget::{Exceeded, Limit};
use mirrorstats_metric::columns::Type;
use mirrorstats_metric::logical_plan::plan::Op;

/// The bytes that the values of all steps take for one batch, which are kept until the batch is scored.
const LARGEST_BATCH: Limit = Limit::new("bytes of values of the definitions for an episode", 128 << 20);

/// Larger files may cause more work.
const SMALL: u64 = 1 << 20;

/// The most bytes that the definitions may read and write over all rows of files of this size.
const fn most_work(bytes: u64) -> Limit {
    Limit::new("bytes computed, rows times values of the definitions, in files of their size", 8 << 30).and_beyond(
        SMALL,
        64 << 10,
        bytes,
    )
}

impl PhysicalPlan {
    /// Checks that the vectors of all steps fit into memory for this number of rows and episodes.
    pub(crate) fn check_batch(&self, rows: usize, episodes: usize) -> Result<(), Exceeded> {
        let bits = self.steps.iter().fold(0_u64, |sum, step| {
            let values = if step.shape == Shape::Timesteps { rows } else { episodes };
            sum.saturating_add(bits_of(step).saturating_mul(values as u64))
        });
        LARGEST_BATCH.check(bits / 8)
    }

    /// Checks the work of all steps over this number of rows, of files of this size.
    pub(crate) fn check_work(&self, rows: u64, bytes: u64) -> Result<(), Exceeded> {
        let bits = |step: &Step| if step.shape == Shape::Timesteps { bits_of(step) } else { 0 };
        let per_row = self.steps.iter().fold(0_u64, |sum, step| {
            // `case` reads a branch value by value, whatever its type.
            let least = if matches!(step.kernel, Kernel::Op(Op::Case { .. } | Op::Coalesce(_))) {
                bits(step).min(64) * 8
            } else {
                0
            };
            let operands = step.kernel.operands();
            let read = operands.iter().map(|operand| bits(self.step(*operand)).max(least)).sum::<u64>();
            sum.saturating_add(bits(step)).saturating_add(read)
        });
        most_work(bytes).check(per_row.saturating_mul(rows) / 8)
    }
}

fn bits_of(step: &Step) -> u64 {
    match (&step.kernel, step.shape, step.ty) {
        (_, Shape::One, _) => 0,
        // A row range.
        (Kernel::Within(_), ..) => 256,
        (_, _, Type::Bool) => 2,
        (_, _, Type::Int | Type::Float) => 65,
        (_, _, Type::Text) => 33,
    }
}
