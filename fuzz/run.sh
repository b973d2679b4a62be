#!/usr/bin/env bash
# Feeds made-up files to everything that reads files.
#
#   fuzz/run.sh [SECONDS] [TARGET…]     each target of fuzz/targets, or those named, that long; by default an hour
#
# Needs cargo-fuzz (cargo install cargo-fuzz). A stable compiler will do: what coverage needs is allowed by RUSTC_BOOTSTRAP,
# and without unsafe code of our own on these ways a sanitizer has little to find; SANITIZER=address asks for it.
# Seeds are the files that other tests read, and what was found before (tests/corpora). An input is a finding if it ends the
# program, takes longer than 10 s or more than 2 GB; it is left in fuzz/artifacts/TARGET. To make one small:
#
#   cd fuzz && RUSTC_BOOTSTRAP=1 cargo fuzz tmin --fuzz-dir . --sanitizer none TARGET artifacts/TARGET/FILE
#
# and to keep it, put it into tests/corpora/TARGET, where `cargo test --test loading corpora` reads it.
set -uo pipefail
cd "$(dirname "$0")" || exit 2
export RUSTC_BOOTSTRAP=1
seconds=${1:-3600}
shift
[ $# -gt 0 ] || set -- $(cd targets && ls -- *.rs | sed 's/\.rs$//' | grep -v '^support$')

# Copies files to begin with into the corpus of a target.
seeds() {
    mkdir -p "corpus/$target" "../tests/corpora/$target"
    for file in "$@" ../tests/corpora/"$target"/*; do
        [ ! -f "$file" ] || cp "$file" "corpus/$target/$(cksum <"$file" | tr ' ' -)"
    done
}

# A small run of each method, stopped where its checkpoint is written; by the program RELT where that is given.
checkpoints() {
    local made relt=(cargo run --quiet --release --manifest-path ../Cargo.toml --)
    made=$(mktemp -d)
    [ -z "${RELT:-}" ] || relt=("$RELT")
    for method in path mlt re; do
        # without the checksum at the end, which the target adds
        "${relt[@]}" render ../scenes/cornell-box/scene.xml -D res=4 --quiet --method $method --mpp 16 \
            --mapping unidirectional --output "$made/$method.exr" \
            --checkpoint-file "$made/$method.state" --checkpoint 1ms && head -c -4 "$made/$method.state" >"$made/$method.seed"
    done
    seeds "$made"/*.seed
    rm -r "$made"
}

findings=0
for target; do
    dictionary=
    case $target in
    scene) seeds ../tests/mitsuba/*.xml ../scenes/*/scene.xml && dictionary=scene ;;
    convert_mitsuba) seeds ../tests/convert/mitsuba/*.xml && dictionary=scene ;;
    convert_pbrt) seeds ../tests/convert/pbrt/*.pbrt && dictionary=pbrt ;;
    obj) seeds ../tests/mitsuba/meshes/*.obj && dictionary=obj ;;
    ply) seeds ../tests/mitsuba/meshes/*.ply && dictionary=ply ;;
    serialized) seeds ../tests/mitsuba/meshes/*.serialized ;;
    picture) seeds ../tests/mitsuba/textures/*.{png,jpg,exr} ../tests/mitsuba/point.exr ;;
    study) seeds ../scenes/studies/*.toml && dictionary=study ;;
    checkpoint) checkpoints ;;
    *) echo "no target $target" && exit 2 ;;
    esac
    cargo fuzz run --fuzz-dir . --sanitizer "${SANITIZER:-none}" "$target" -- -max_total_time="$seconds" -timeout=10 \
        -rss_limit_mb=2048 -max_len=65536 ${dictionary:+-dict=dictionaries/$dictionary.dict} -print_final_stats=1 ||
        findings=$((findings + 1))
done
[ $findings -eq 0 ] || echo "$findings targets found something; see fuzz/artifacts"
exit $((findings > 0))
