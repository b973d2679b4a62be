#!/bin/bash
# A job in parts as tasks of HyperQueue, with a server and workers that run already (`hq server start`, `hq worker start`):
# a task a part, each with some cores, tried again where a worker is lost, and then gone on with from its checkpoint.
#
#     hyperqueue.sh 64 scene.xml image.exr --mpp 65536
#     relt merge image.*-of-64.part -o image.exr          # at any time
set -eu
parts=$1 scene=$2 image=$3
shift 3
exec hq submit --array "1-$parts" --cpus "${CORES:-4}" --crash-limit 10 -- \
    "${RELT:-relt}" render "$scene" -o "$image" --part "hq/$parts" --checkpoint "${CHECKPOINT:-10m}" --resume auto "$@"
