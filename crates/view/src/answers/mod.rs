//! The answers of the page, one file each.

pub(super) mod changes;
pub(super) mod compare;
pub(super) mod episode;
pub(super) mod labels;
pub(super) mod list;
pub(super) mod live;
pub(super) mod map;
pub(super) mod overview;
pub(super) mod verdict;
