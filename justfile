# What one does every day; `just` lists it.
default:
    @just --list

# formatting and lints
check:
    cargo fmt --check
    rustfmt --edition 2024 --check crates/thruster/src/effects/*.rs
    cargo clippy --workspace --all-targets -- -D warnings

# every test, with what they need
test:
    tests/run.sh

# the live service on the simulated stand
up:
    cargo run --release

# control laws compared on the shipped soak scenarios
soak *SCENARIOS:
    cargo run --release -- soak {{SCENARIOS}}

# the blind proof on fresh seeds, written to docs/proof.md
prove *ARGS:
    cargo run --release -- prove --markdown docs/proof.md {{ARGS}}

# the fault campaign: each process killed 1000 times (for so long at most), and the rest of docs/operations.md's table
faults KILLS="1000" MINUTES="60" LANES="8":
    KORT_FAULT_KILLS={{KILLS}} KORT_FAULT_MINUTES={{MINUTES}} KORT_FAULT_LANES={{LANES}} cargo test --test faults -- --nocapture

# 2,000 slow sockets from one peer: how late the servo wakes (p99, idle and beset in turn) and how long stop takes
slow-sockets ROUNDS="90" WINDOW_MS="1000":
    KORT_SLOW_ROUNDS={{ROUNDS}} KORT_SLOW_MS={{WINDOW_MS}} cargo test --test access slow_sockets -- --nocapture

# eight signals at 50 Hz in the console's plots, ten minutes in view: rows and pictures lost
console-load SECONDS="600":
    KORT_CONSOLE_S={{SECONDS}} cargo test --test console eight_signals -- --nocapture

# the picture of the console in the README, made by the test that an operator's way through it is
picture:
    KORT_CONSOLE_PICTURE="$PWD/docs/console.png" cargo test --test console an_operator_takes_command

# fuzz an entry point: csv, mcap, toml, deployment, bodies, messages or wires (nightly, cargo-fuzz)
fuzz TARGET SECONDS="60":
    mkdir -p fuzz/corpus/{{TARGET}}
    cargo +nightly fuzz run {{TARGET}} fuzz/corpus/{{TARGET}} $(fuzz/seeds.sh {{TARGET}}) -- -max_total_time={{SECONDS}} -rss_limit_mb=4096

# the Python package: abi3 wheel, types, stubs, tests, notebooks, in an environment below target
python:
    python/tests/run.sh

# undefined behaviour in what shared memory carries: messages, texts, freshness (nightly, miri)
miri:
    cargo +nightly miri test -p kort-proto --test payloads

# for the computers aboard, without the laboratory: cross-built for arm64 (Raspberry Pi 4 and 5, Jetson) with Debian's compiler
arm64:
    rustup target add aarch64-unknown-linux-gnu
    command -v aarch64-linux-gnu-gcc || apt-get install -y --no-install-recommends gcc-aarch64-linux-gnu libc6-dev-arm64-cross
    CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=aarch64-linux-gnu-gcc CC_aarch64_unknown_linux_gnu=aarch64-linux-gnu-gcc \
        cargo build --release --target aarch64-unknown-linux-gnu --no-default-features --features servo,controller,gateway
    ls -l target/aarch64-unknown-linux-gnu/release/kort

# the pure crates' tests on arm64, under qemu-user
arm64-test:
    command -v qemu-aarch64 || apt-get install -y --no-install-recommends qemu-user
    CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=aarch64-linux-gnu-gcc CC_aarch64_unknown_linux_gnu=aarch64-linux-gnu-gcc \
        CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_RUNNER="qemu-aarch64 -L /usr/aarch64-linux-gnu" \
        cargo test --target aarch64-unknown-linux-gnu -p kort-thruster -p kort-control -p kort-scenario --lib

# a Debian package of this machine's architecture, with its systemd unit (cargo install cargo-deb)
deb:
    cargo deb
