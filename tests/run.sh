#!/usr/bin/env bash
# Every test of kort. On a bare machine (Rust, a C compiler, root on Debian) it fetches what is missing:
#   curl (pages of docs are followed), prometheus (real scrapes, promtool), chromium (the console),
#   schemathesis (the API against its own OpenAPI), maturin, mypy, pytest, pandas, polars, matplotlib and nbclient (the Python package).
# Without root nothing is installed; what is absent is then left out, and the last lines say so.
set -euo pipefail
cd "$(dirname "$0")/.."
tools="${KORT_TEST_TOOLS:-$PWD/target/test-tools}"
skipped=()

say() { printf '\n== %s\n' "$*"; }

# install PACKAGE…: with apt, when we are root on Debian.
install() {
  [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null || return 0
  say "installing $*"
  [ -n "${apt_updated:-}" ] || { apt-get update -qq || true; apt_updated=1; }
  DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@" >/dev/null || true
}

# need COMMAND PACKAGE…: install when COMMAND is missing.
need() {
  local command=$1; shift
  command -v "$command" >/dev/null || install "$@"
  command -v "$command" >/dev/null || skipped+=("$command is not installed (Debian: $*)")
}

need cc build-essential
need promtool prometheus
need chromium chromium fonts-dejavu-core
need curl curl
need python3 python3 python3-venv

mkdir -p "$tools"
schemathesis="$tools/schemathesis/bin/schemathesis"
if command -v python3 >/dev/null && [ ! -x "$schemathesis" ]; then
  say "installing schemathesis into $tools"
  python3 -m venv "$tools/schemathesis" >/dev/null 2>&1 ||
    { install python3-venv; python3 -m venv "$tools/schemathesis" || true; }
  "$tools/schemathesis/bin/pip" install -q 'schemathesis>=4,<5' || true
fi
if [ -x "$schemathesis" ]; then export KORT_SCHEMATHESIS="$schemathesis"; else skipped+=("schemathesis is not installed"); fi

# A stranger's reader of recordings, beside schemathesis.
python="$tools/schemathesis/bin/python"
if [ -x "$python" ]; then "$python" -c 'import mcap' 2>/dev/null || "$tools/schemathesis/bin/pip" install -q 'mcap>=1.2,<2' || true; fi
if [ -x "$python" ] && "$python" -c 'import mcap' 2>/dev/null; then export KORT_PYTHON="$python"; else skipped+=("Python's mcap is not installed"); fi

# What the Python package's tests need, fetched while the others are built.
notebook="$tools/python/bin/python"
if command -v python3 >/dev/null; then
  { [ -x "$notebook" ] || python3 -m venv "$tools/python"; "$notebook" -m pip install -q -r python/tests/requirements.txt; } \
    >"$tools/python.log" 2>&1 &
  fetching=$!
fi

# Nothing is built a second time here.
export CARGO_INCREMENTAL=0
# Most tests of the program wait for a running service; what computes, or draws a page, takes its turn by itself.
export RUST_TEST_THREADS=4
say "cargo test --workspace"
cargo test --workspace --no-fail-fast

if [ -n "${fetching:-}" ] && wait "$fetching"; then
  say "the Python package: wheel, types, tests, notebooks"
  python/tests/run.sh "$notebook"
else
  skipped+=("the Python package: its environment is not there ($tools/python.log)")
fi

# Fuzzing where its tools are; elsewhere tests/any_input.rs stands in for it.
if cargo +nightly fuzz --version >/dev/null 2>&1; then
  for target in csv mcap toml deployment bodies messages wires; do
    say "fuzzing $target for a minute"
    mkdir -p "fuzz/corpus/$target"
    cargo +nightly fuzz run "$target" "fuzz/corpus/$target" $(fuzz/seeds.sh "$target") -- -max_total_time=60 -rss_limit_mb=4096
  done
else
  skipped+=("cargo fuzz (needs nightly and cargo-fuzz); its entry points were given random input by tests/any_input.rs")
fi

say "all tests passed"
for line in ${skipped[@]+"${skipped[@]}"}; do echo "not run: $line"; done
