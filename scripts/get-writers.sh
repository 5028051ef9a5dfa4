#!/bin/sh
# Programs that write Parquet. Spark and parquet-java are those of scripts/get-spark.sh.
exec "$(dirname "$0")/get-packages.sh" python-writers pyarrow==26.0.1 duckdb==2.0.0 polars==2.1.0 datafusion==55.0.0 \
  fastparquet==2026.9.0 pandas==3.1.1
