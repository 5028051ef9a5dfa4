//! Other engines that run the SQL lowering of a plan: Polars in this process, Spark on a cluster.

pub mod spark;
