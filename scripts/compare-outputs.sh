#!/bin/bash
# Runs every command that prints or writes analysis output on fixtures/ with two builds of the program, and compares what
# they print, what they write and how they exit, byte for byte: scripts/compare-outputs.sh OLD NEW [FOLDER].
# Exits with 1 if anything differs, and lists each difference. Commands have names that builds of before the grouping by noun
# know too. A build without a feature refuses its commands, so that both builds must have the same features.
set -u
[ $# -ge 2 ] || { echo "usage: $0 OLD NEW [FOLDER]" >&2; exit 2; }
old=$(realpath "$1") && new=$(realpath "$2") || exit 2
root=$(cd "$(dirname "$0")/.." && pwd)
work=${3:-$(mktemp -d)}
export MIRRORSTATS_CONFIG_FILE= NO_COLOR=1 LC_ALL=C
unset COLUMNS

# run NAME ARGUMENTS...: both builds, each in a folder of its own.
run() {
  local name=$1 side
  shift
  for side in old new; do
    (
      cd "$work/$side" || exit 2
      "${!side}" "$@" > "printed/$name.out" 2> "printed/$name.err" < /dev/null
      echo $? > "printed/$name.code"
    )
  done
}

for side in old new; do
  rm -rf "${work:?}/$side"
  mkdir -p "$work/$side/printed"
  cp -r "$root/fixtures" "$root/assets" "$work/$side"
  sed 's/\[experiment\.E3/[experiment.MINE/' "$root/assets/experiments/E3.toml" > "$work/$side/experiment.toml"
  cat > "$work/$side/mine.toml" <<'TOML'
include = ["paper"]
[metric.TURNS]
title = "Turns before the decision"
value = "count(action in ('turn_left', 'turn_right') and t < finish)"
TOML
  cat > "$work/$side/steps.jsonl" <<'JSON'
{"episode_id":"a","model":"m","experiment":"E1","seed":1,"run":1,"t":1,"action":"turn_left","body_color":"red","self_color":null,"selected_cube":null,"mirror_visible":true,"mirror_self_visible":false}
{"episode_id":"a","model":"m","experiment":"E1","seed":1,"run":1,"t":2,"action":"done","body_color":"red","self_color":"red","selected_cube":"red","mirror_visible":true,"mirror_self_visible":true}
JSON
  head -c 200000 "$root/fixtures/recorded/E1-guesser.mcap" > "$work/$side/cut.mcap"
done

paper=fixtures/paper
recorded=fixtures/recorded
some="$recorded/E1-oracle.parquet $recorded/E1-random.parquet"

run report report $paper --out report
run report-json report $paper --out report-json --no-figures --json
run report-paper report $paper --style paper --out report-paper
run report-extended report $recorded --definitions extended --out report-recorded
run report-by report $paper --by model,seed --where "experiment <> 'E2'" --no-figures --out report-by
run report-lost report $recorded --lost as-failure --pool --no-figures --out report-lost
COLUMNS=60 run report-narrow report $paper --no-figures --out report-narrow
run score score $paper
run score-json score $recorded --json
for ending in parquet csv jsonl; do run score-$ending score $paper -o scores.$ending; done
run score-explain score $paper --explain "$(cd "$root" && "$old" score $paper --where "experiment = 'E1'" | sed -n 2p | cut -d, -f1)"
run score-own score $paper --definitions mine.toml --metrics TURNS
run score-filter score $paper --where "TSA = 1 and seed = 1"
run score-empty score $paper --where "seed = 99"
run scores-report report scores.parquet --no-figures --out report-scores
for name in spider heatmap scatter completion-gap e5-outcomes intervals slopes decision-curve gaze; do
  for ending in svg png pdf; do run figure-$name-$ending figure $name $paper -o $name.$ending; done
  run figure-$name-recorded figure $name $recorded
done
run stats stats $paper
run stats-all stats $paper --metric all --full
run stats-json stats $paper --json
run stats-recorded stats $recorded --json
run stats-sequential stats $paper --sequential
run stats-sequential-json stats $paper --sequential --json
run diff diff paper extended $paper
run diff-own diff paper mine.toml $paper --json
run diff-scores diff scores.parquet scores.csv
run rescore table rescore report --definitions mine.toml --traces fixtures/paper --out rescored
run rescore-json table rescore report --definitions extended --traces fixtures/paper --out rescored-json --json
run verify verify report
run verify-json verify report --json
for table in main appendix; do
  run compare-$table table compare $paper --published fixtures/published/${table}_table.csv
  run compare-$table-json table compare $paper --published fixtures/published/${table}_table.csv --json
  run audit-$table table audit fixtures/published/${table}_table.csv --n 21
done
run audit-json table audit fixtures/published/main_table.csv fixtures/published/appendix_table.csv --n 21 --json
run audit-rounding table audit fixtures/published/main_table.csv --n 21 --rounding half-up,truncate
run plan plan --difference 0.3
run plan-runs plan --runs 7
run plan-json plan --runs 7 --models 2 --chance 1/3 --json
run plan-register plan --difference 0.3 --register plan.json
run sensitivity definitions sensitivity $recorded --out thresholds
run sensitivity-json definitions sensitivity $recorded --json
for command in info validate; do
  for inputs in $paper $recorded fixtures/damaged fixtures/checksums fixtures/glimpses.parquet; do
    run "$command-${inputs//\//-}" trace $command $inputs
    run "$command-${inputs//\//-}-json" trace $command $inputs --json
  done
done
run info-episodes trace info $recorded --episodes
for damaged in "$root"/fixtures/damaged/*.parquet; do
  name=$(basename "$damaged" .parquet)
  run "damaged-$name" score "fixtures/damaged/$name.parquet"
  run "damaged-$name-json" --errors json score "fixtures/damaged/$name.parquet"
done
run check trace check $recorded --max-unreadable 0.05
run check-json trace check $recorded --max-lost 0 --json
run check-paper trace check $paper --max-unreadable 0.05
run check-none trace check $recorded
run import import steps.jsonl -o imported.parquet
run import-json import steps.jsonl -o imported-json.parquet --palette red,green --cluster seed --json
run import-refused import mine.toml -o never.parquet
run recover trace recover $recorded/E1-guesser.mcap -o recovered.parquet
run recover-cut trace recover cut.mcap -o cut.parquet --json
for name in trace step experiments experiment reply-cubes reply-exploration; do run schema-$name trace schema $name --json; done
run schema trace schema
for dialect in portable spark duckdb; do
  run sql-$dialect definitions sql --dialect $dialect
  run sql-$dialect-extended definitions sql --dialect $dialect --definitions extended $recorded
done
run query query "SELECT model, COUNT(*) AS steps FROM steps GROUP BY model ORDER BY model" $paper
run query-episodes query "SELECT * FROM episodes ORDER BY episode_id" $recorded
run query-cells query "SELECT * FROM cells ORDER BY experiment, model, metric" $paper --format csv
run query-jsonl query "SELECT * FROM cells ORDER BY experiment, model, metric" $recorded --format jsonl
run query-parquet query "SELECT * FROM episodes ORDER BY episode_id" $paper -o answer.parquet
run query-refused query "SELECT nothing FROM steps" $recorded
for definitions in paper extended mine.toml; do
  run definitions-check-${definitions%.toml} definitions check $definitions
  run definitions-check-${definitions%.toml}-json definitions check $definitions --json
done
run definitions-show definitions show extended
for metric in $(cd "$root" && "$old" definitions check extended --json | sed -n 's/^    "\(.*\)",\{0,1\}$/\1/p'); do
  run "definitions-explain-$metric" definitions explain "$metric" --definitions extended
  run "definitions-explain-$metric-json" definitions explain "$metric" --definitions extended --json
done
for style in paper default; do run style-$style style show $style; run style-check-$style style check $style; done
run experiments experiments show
for file in "$root"/assets/experiments/*.toml; do
  name=$(basename "$file" .toml)
  run "experiments-show-$name" experiments show "$name"
  run "experiments-explain-$name" experiments explain "$name"
  run "experiments-explain-$name-json" experiments explain "$name" --json
  run "experiments-check-$name" experiments check "assets/experiments/$name.toml"
done
run experiments-check-own experiments check experiment.toml
run experiments-explain-own experiments explain experiment.toml --json
run world-config world config
run world-scene world scene E1..E5 --seed 2 --run 3
run world-sheet world sheet --out sheet
run record record --agent oracle --experiment E1 --seeds 1 --runs 1 --out runs
run forecast record --agent vlm --model gpt-5.1 --dry-run
run replay world replay $recorded/E1-oracle.parquet --json
run filmstrip world filmstrip E1/oracle/s1/r1 $some -o strip.png
run export view $recorded --export page
run refused score nosuch.parquet
run refused-json --errors json score $paper --where "TSAA = 1"

# Times are of the run; new names of commands are no difference in the words around them.
sed -i -E 's/ in [0-9.]+ s( \([0-9]+ steps a second\))?/ in N s/; s/[0-9.]+ (s of|%)/N \1/g' "$work"/{old,new}/printed/record.err
nouns='table (audit|compare|rescore|verify)|trace (check|info|recover|renormalize|schema|validate)|definitions (sensitivity|sql)'
sed -i -E "s/mirrorstats (($nouns)|world (filmstrip|replay)|setup (completions|config|man))/mirrorstats \3\4\5\6\7/g" \
  "$work"/{old,new}/printed/*.{out,err}
if diff -r --brief "$work/old" "$work/new" > "$work/differences"; then
  echo "no difference in $(ls "$work/old/printed"/*.code | wc -l) commands and $(find "$work/old" -type f | wc -l) files; they are in $work"
else
  cat "$work/differences"
  echo "$(wc -l < "$work/differences") differences; the files are in $work"
  exit 1
fi
