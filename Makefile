# The commands of the README: `make demo`, `make test` and `make test-all`.

.DELETE_ON_ERROR:
.PHONY: demo test test-all check-default others fmt lint needed needed-others unit soak fuzz docs book end-to-end clients wheel test-wheel bless release-check check-lerobot recorded calibrate questions seeing bench bench-import bench-scores bench-shape bench-world bench-agents bench-gym bench-view instructions bless-instructions instruction-programs sheet

## Build, record a few episodes of the scripted agents, report on them, say where the results are.
demo:
	scripts/demo.sh

## What a change needs: format, clippy, unit and boundary tests, doc examples, the published tables from outside.
test: fmt lint unit end-to-end

## The rest of what CI checks: programs of others, power cuts, the browser suite, long rounds, the book, the wheel.
test-all: test check-default others clients docs test-wheel

fmt:
	cargo fmt --all --check

# With everything: Polars, and the world on MuJoCo's library.
lint:
	scripts/get-mujoco.sh
	cargo clippy --workspace --all-targets --all-features -- -D warnings

# As most people build it.
check-default:
	cargo check --workspace --exclude mirrorstats-fuzz --exclude mirrorstats-python --exclude mirrorstats_publish --exclude mirrorstats_view \
		--exclude mirrorstats_sim --exclude mirrorstats_record --exclude mirrorstats_vlm --all-targets

# What the tests of `make test` need; each script says what it cannot get.
needed:
	scripts/get-browser.sh
	scripts/get-duckdb.sh
	scripts/get-egl.sh
	scripts/get-mujoco.sh

# What the other tests need too.
needed-others: needed
	scripts/get-axe.sh
	scripts/get-datasets.sh
	scripts/get-harnesses.sh
	scripts/get-numpy.sh
	scripts/get-spark.sh
	scripts/get-tex.sh
	scripts/get-writers.sh

unit: needed
	scripts/test.sh short

others: needed-others
	scripts/test.sh long

## The campaigns that are too long for CI, with their full numbers of rounds: benches/SOAK.md.
soak: needed-others
	cargo test --workspace --all-features --no-fail-fast -- --ignored soak

## Every fuzz target guided by coverage, MINUTES in all; what is found is kept, and the exit code is not 0: benches/FUZZ.md.
MINUTES = 10
fuzz:
	scripts/fuzz.sh $(MINUTES)

docs: book
	RUSTDOCFLAGS="-D warnings" cargo doc --no-deps --workspace --exclude mirrorstats-fuzz --exclude mirrorstats-python --all-features --quiet

## The book of docs/, searchable, in target/book.
book:
	scripts/book.sh

## The main job from outside: the committed report again byte for byte, the published tables cell by cell.
end-to-end:
	scripts/end-to-end.sh

# Logs as MCAP's own packages read them, and requests as the providers' own client libraries send them.
clients:
	scripts/check-packages.sh

## The wheel for others: the command and the Python package, for every Linux with glibc 2.28 or newer. A long build.
wheel:
	scripts/wheel.sh

# The package as its users have it, installed where there is no Rust; from the dependencies that the tests have compiled.
test-wheel: needed-others
	scripts/test-wheel.sh

## The checks before a release.
release-check: needed-others
	scripts/release-check.sh

## Write generated files anew: JSON Schemas, snapshots, the committed report.
bless: needed-others
	MIRRORSTATS_WRITE_SCHEMAS=1 MIRRORSTATS_WRITE_REFERENCE=1 INSTA_UPDATE=always cargo test --workspace --all-features --no-fail-fast
	scripts/python-types.py
	cargo run --quiet -- report fixtures/paper --style paper --png --out reports/paper
	cd reports/paper && sha256sum report.html >../report.html.sha256

## The bundled recordings anew: fixtures/recorded.
recorded:
	scripts/record-fixtures.sh

## The scripted agents in 21 episodes of each experiment: checks their metric profiles and writes the table of them.
calibrate:
	scripts/get-mujoco.sh
	cargo test --release --features sim --test agents -- --ignored twenty_one
	@echo "The table is in reports/world/calibration.md."

## What LeRobot's own package writes, through `import`: 6 GB of packages in target.
check-lerobot:
	cargo build --features polars
	scripts/check-lerobot.sh $${CARGO_TARGET_DIR:-target}/debug/mirrorstats

## The four questions of the world for the scripted agents: reports/world/questions.md and dose-response.svg; long.
questions:
	scripts/world-questions.sh

## The agents that see, from pixels through HTTP: reports/world/seeing.md; RUNS=2 is a quick look.
seeing:
	scripts/seeing.sh

## All that is measured beside models: scoring, then the world.
bench: bench-scores bench-world

## How fast scoring is beside other engines, and where the time goes: benches/RESULTS.md. A quick look, which writes
## target/bench/RESULTS.md: STEPS=1400000 ROUNDS=3. LARGE=140000000 measures ten times the steps too.
STEPS = 14150000
FILES = 4
ROUNDS = 9
LARGE = 0
BENCH_RESULTS = $(if $(filter 14150000,$(STEPS)),benches,target/bench)/RESULTS.md
BENCH_PYTHON = target/bench-python
BENCH_PACKAGES = duckdb==2.0.0 polars==2.1.0 pandas==3.1.1 pyarrow==26.0.1
bench-scores:
	mkdir -p target/bench
	cargo build --release --no-default-features --bin mirrorstats --example generate --example decode
	python3 -m pip install --quiet --upgrade --target $(BENCH_PYTHON) $(BENCH_PACKAGES)
	PYTHONPATH=$(BENCH_PYTHON) python3 scripts/bench/bench.py --program $${CARGO_TARGET_DIR:-target}/release/mirrorstats \
		--steps $(STEPS) --files $(FILES) --rounds $(ROUNDS) --large $(LARGE) \
		--results $(BENCH_RESULTS)

## How time and memory grow with steps, episodes, files, models, metrics and columns: benches/SHAPE.md, in minutes.
bench-shape:
	mkdir -p target/bench
	cargo build --release --no-default-features --bin mirrorstats --example generate
	python3 scripts/bench/shape.py --program $${CARGO_TARGET_DIR:-target}/release/mirrorstats

## The instructions of commands on a small trace: more than 3 % more than in benches/instructions.txt fails. The program is
## that of bench-scores. The generator is that of the tests, which are built already where CI comes here.
INSTRUCTIONS = $${CARGO_TARGET_DIR:-target}/release/mirrorstats $${CARGO_TARGET_DIR:-target}/debug/examples/generate
instructions: instruction-programs
	scripts/bench/instructions.py $(INSTRUCTIONS)

## Write benches/instructions.txt anew.
bless-instructions: instruction-programs
	scripts/bench/instructions.py $(INSTRUCTIONS) --bless

instruction-programs:
	scripts/get-valgrind.sh
	scripts/get-mujoco.sh
	cargo build --release --no-default-features --bin mirrorstats
	cargo build --workspace --all-features --example generate

## How fast the world is: steps a second with and without frames, and where the time goes.
bench-world:
	scripts/get-mujoco.sh
	cargo bench --features sim --bench world

## What waiting for a model costs: steps a second with an agent that answers at once, and with a server that takes a
## second for each answer, 64 episodes in flight. STEPS=100 measures longer.
bench-agents:
	scripts/get-mujoco.sh
	cargo bench --features sim --bench agents

## What an environment for harnesses costs: beside `record`, with small frames for training, in vectors, and its memory in
## 1,000 episodes. WHEEL=FILE measures that wheel; without it, one is built, which takes long.
WHEEL =
bench-gym:
	scripts/bench/gym.sh $(WHEEL)

## Memory and time of the import of 200,000 samples of Inspect, beside `inspect log dump`, and of 14 million steps in
## Parquet, beside Polars; SAMPLES and STEPS say how many.
bench-import:
	scripts/bench/import.sh
	scripts/bench/import_parquet.sh

## How soon `view` shows a list, an episode and its next frame in Chromium, beside Inspect View, in turns: benches/VIEW.md.
bench-view:
	scripts/bench/view.sh

## The contact sheet of the five experiments anew, and the table of what agents see of themselves.
sheet:
	scripts/get-mujoco.sh
	cargo run --quiet --features sim -- world sheet --out reports/world
	cargo run --quiet --features sim -- world sheet --experiment examples/experiments/mirrors.toml --out target/sheet
	cp target/sheet/sheet.png docs/images/mirrors.png
	cargo run --quiet --features sim -- world visibility "$$(cargo run --quiet --features sim -- experiments show | cut -d' ' -f1 | paste -sd,)" > reports/world/visibility.md
