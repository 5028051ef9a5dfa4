//! The declared design, in the form used by statistics.

use statistics::design::{Cluster, Design, DesignKind};
use trace::declared::{self, Declared, Origin};

pub(crate) fn design_of(declared: &Declared) -> Design {
    let kind = |origin| match origin {
        Origin::Recording => DesignKind::Recording,
        Origin::Import => DesignKind::Import,
        Origin::Reconstruction => DesignKind::Reconstruction,
    };
    let cluster = |cluster| match cluster {
        declared::Cluster::Seed => Cluster::Seed,
    };
    Design { kind: declared.origin.map(kind), cluster: declared.cluster.map(cluster) }
}
