#!/usr/bin/env bash
# Puts known bugs into a copy of the tree, one at a time, and shows that tests fail for each.
#
#   tests/sabotage/run.sh [NAME…]     all of them, or those patches of this folder
#
# Each patch says in its head what the bug is and which tests are to fail (arguments of cargo test). Those tests must pass
# without any patch, which is seen to first; a patch that does not apply or does not compile counts as a failure of its own.
# The copy is built in target/sabotage, apart from all else. It takes a minute or two for each bug.
set -uo pipefail
here=$(cd "$(dirname "$0")" && pwd)
root=$(cd "$here/../.." && pwd)
export CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$root/target}/sabotage
export CARGO_PROFILE_RELEASE_LTO=off CARGO_PROFILE_RELEASE_INCREMENTAL=true CARGO_PROFILE_RELEASE_CODEGEN_UNITS=64
copy=$CARGO_TARGET_DIR/tree
rm -rf "$copy" # and with it all times of change: what was built with a bug is not taken for fresh
mkdir -p "$copy" "$CARGO_TARGET_DIR/logs"

cd "$root" || exit 2
# what git knows of, as it is now
git ls-files -z | xargs -0 cp --parents -t "$copy" || exit 2
cd "$copy" || exit 2

if [ $# -gt 0 ]; then
    patches=("${@/%/.patch}")
    patches=("${patches[@]/#/$here/}")
else
    patches=("$here"/*.patch)
fi
field() { sed -n "s/^$1: //p;/^---/q" "$2"; }

# Runs the tests of a patch, writes the names of those that failed, and answers 0 if all passed, 1 if some failed and 2 if
# they could not be built. Several names need several runs, as a test binary takes one list only.
run_tests() {
    local arguments log=$2
    read -r -a arguments <<<"$1"
    local target=() names=() i
    for i in "${!arguments[@]}"; do
        [ "${arguments[$i]}" = -- ] && break
        target+=("${arguments[$i]}")
    done
    names=("${arguments[@]:$((i + 1))}")
    cargo test --release "${target[@]}" --no-run >"$log" 2>&1 || return 2
    if ! cargo test --release "${target[@]}" -- "${names[@]}" >>"$log" 2>&1; then
        grep -E '^test .* FAILED$' "$log" | cut -d' ' -f2 | paste -sd' '
        return 1
    fi
    grep -qE '^test .* ok$' "$log" || return 2 # names that no test has
}

missed=0
row() { printf '%-32s %-9s %5s  %s\n' "$@"; }
row bug verdict s 'tests that failed'
for patch in "${patches[@]}"; do
    [ -f "$patch" ] || { echo "no such patch: $patch" >&2; exit 2; }
    field test "$patch"
done | sort -u >"$copy/tests-of-all"
while read -r tests; do
    begin=$SECONDS
    if ! failed=$(run_tests "$tests" "$CARGO_TARGET_DIR/logs/none.log" </dev/null); then
        row none BROKEN $((SECONDS - begin)) "$tests: ${failed:-see $CARGO_TARGET_DIR/logs/none.log}"
        exit 2
    fi
    row none passes $((SECONDS - begin)) "($tests)"
done <"$copy/tests-of-all"
for patch in "${patches[@]}"; do
    name=$(basename "$patch" .patch)
    begin=$SECONDS
    if ! git apply "$patch"; then
        row "$name" 'NO FIT' 0 'the patch does not apply'
        missed=$((missed + 1))
        continue
    fi
    failed=$(run_tests "$(field test "$patch")" "$CARGO_TARGET_DIR/logs/$name.log" </dev/null)
    case $? in
        1) row "$name" caught $((SECONDS - begin)) "$failed" ;;
        0) row "$name" MISSED $((SECONDS - begin)) "($(field test "$patch"))"; missed=$((missed + 1)) ;;
        *) row "$name" BROKEN $((SECONDS - begin)) "see $CARGO_TARGET_DIR/logs/$name.log"; missed=$((missed + 1)) ;;
    esac
    git apply -R "$patch"
done
[ $missed -eq 0 ]
