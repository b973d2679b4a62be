#!/usr/bin/env bash
# Runs what has `unsafe` code, all of which is in src/embree, under tools that see misuse of memory.
#
#   tests/sanitize.sh miri       our side of the wall without Embree: packets, and the callbacks that Embree has of us
#   tests/sanitize.sh asan       the tests of Embree and the program, all of Rust under AddressSanitizer; Embree's allocations
#                                are watched, its own code is not instrumented
#   tests/sanitize.sh valgrind   the program with Embree's own code under memcheck
#
# miri needs `rustup +nightly component add miri rust-src`, asan any rustc (a stable one is told to take -Z options), valgrind
# a release build. Each builds in a folder of its own below target/ and takes minutes.
set -euo pipefail
cd "$(dirname "$0")/.."
export CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$PWD/target}
host=$(rustc -vV | sed -n 's/^host: //p')

# Scenes with spheres, disks, cylinders, meshes and instances, by every method.
render_all() {
    local scene method out=$CARGO_TARGET_DIR/sanitized
    mkdir -p "$out"
    for scene in everything instances cylinder; do
        for method in path mlt re; do
            "$@" render "tests/mitsuba/$scene.xml" --method "$method" --mapping bidirectional --mpp 1 --threads 2 \
                --packet 8 --quiet --output "$out/$scene.exr"
        done
    done
}

case ${1:-} in
miri)
    export CARGO_TARGET_DIR=$CARGO_TARGET_DIR/miri RELT_EMBREE_FETCH=0
    cargo +nightly miri test --lib embree::packet
    ;;
asan)
    export CARGO_TARGET_DIR=$CARGO_TARGET_DIR/asan RUSTC_BOOTSTRAP=1 RUSTFLAGS='-Zsanitizer=address'
    export CARGO_PROFILE_RELEASE_LTO=off CARGO_PROFILE_RELEASE_OPT_LEVEL=1 CARGO_PROFILE_RELEASE_CODEGEN_UNITS=64
    cargo build --release --target "$host" --bin relt
    render_all "$CARGO_TARGET_DIR/$host/release/relt"
    cargo test --release --target "$host" --lib embree::
    cargo test --release --target "$host" --test embree
    ;;
valgrind)
    cargo build --release --bin relt
    render_all valgrind --quiet --error-exitcode=9 --suppressions=tests/valgrind.supp "$CARGO_TARGET_DIR/release/relt"
    ;;
*)
    sed -n '2,/^set/s/^# \{0,1\}//p' "$0"
    exit 2
    ;;
esac
echo "${1}: nothing found"
