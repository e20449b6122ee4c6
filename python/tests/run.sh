#!/usr/bin/env bash
# Builds the abi3 wheel, installs it into an environment of its own, checks types and stubs, runs tests and notebooks:
#   python/tests/run.sh [PYTHON]
# PYTHON has what requirements.txt names; without it an environment is made in target/test-tools.
set -euo pipefail
cd "$(dirname "$0")/../.."
target="${CARGO_TARGET_DIR:-$PWD/target}"
if [ $# -eq 0 ]; then
    set -- "$target/test-tools/python/bin/python"
    [ -x "$1" ] || python3 -m venv "$target/test-tools/python"
    "$1" -m pip install --quiet -r python/tests/requirements.txt
fi
bin="$(cd "$(dirname "$1")" && pwd)"
python="$bin/$(basename "$1")"
wheels="$target/wheels"
rm -rf "$wheels"

# The program to compare with, with the features of the tests' own build: after it this does nothing.
cargo build --quiet --workspace --test tidy --bin kort
KORT_CARGO="$(command -v cargo)" PATH="$PWD/python/tests:$bin:$PATH" PYO3_PYTHON="$python" \
    "$bin/maturin" build --quiet --profile dev --manifest-path python/Cargo.toml --interpreter "$python" --out "$wheels" --compatibility linux
wheel="$(ls "$wheels"/kort-*-cp310-abi3-*.whl)"
"$python" -m pip install --quiet --force-reinstall --no-deps "$wheel"
(cd python && "$python" -m mypy)
(cd "$wheels" && "$python" -m mypy.stubtest kort._kort)
KORT="$target/debug/kort" MPLBACKEND=agg "$python" -m pytest -q --durations=5 python/tests -p no:cacheprovider
