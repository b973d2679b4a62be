#!/bin/bash
# Real engines on this machine, with faults while they run: whatever happens, the merged image is that of `--parts N` bit by
# bit, and nothing is lost but the work since the last checkpoint.
#
#     cargo build --release && tests/engines/run.sh [hyperqueue] [slurm] [mpi] [network] [faults]
#
# Not part of `cargo test`, for it wants what few machines have:
#   hyperqueue  python3 with venv; installs HyperQueue from PyPI into the scratch folder
#   slurm       as root: apt-get install slurm-wlm munge; one node, whose daemons end with the script
#   mpi         apt-get install openmpi-bin; `cargo build --release --features mpi`
#   network     as mpi, and as root with iproute2: two network namespaces are two hosts, and the wire between them is cut
#   faults      as root, for a small tmpfs; apt-get install faketime
# Logs of all that was run stay in the scratch folder, which is told at the end.
set -u
root=$(cd "$(dirname "$0")/../.." && pwd)
export RELT=${RELT:-$root/target/release/relt}
scene=$root/scenes/lattice/scene.xml
job=(-D res=48 --mpp "${MPP:-600}" --replicas 3 --mapping unidirectional --seed 5)
parts=3
scratch=$(mktemp -d "${TMPDIR:-/tmp}/relt-engines.XXXXXX")
failed=0
started=()
hosts=()

say() { printf '%s\n' "$*"; }
# A sentence, then a command that says whether it is true.
holds() {
    local what=$1
    shift
    if "$@"; then say "ok      $what"; else say "FAILED  $what"; failed=1; fi
}
# Ends what this script has started, and nothing else.
clean() {
    local pid
    for pid in "${started[@]}"; do kill "$pid" 2>/dev/null; done
    sleep 2
    for pid in "${started[@]}"; do kill -9 "$pid" 2>/dev/null; done
    for pid in "${hosts[@]}"; do ip netns del "$pid" 2>/dev/null; done
    umount "$scratch/small" 2>/dev/null
    say "logs in $scratch"
}
trap clean EXIT

# Waits until the command holds, a minute at most.
await() { local end=$((SECONDS + 60)); until "$@"; do [ $SECONDS -lt $end ] || return 1; sleep 0.1; done; }
same() { "$RELT" compare --reference "$scratch/whole.exr" "$1" 2>&1 | grep -q "^$1 *0 *0 *0 *1.0000 *0.0000"; }
merged() { "$RELT" merge image.*-of-$parts.part -o image.exr >merge.log 2>&1 && same image.exr; }
went_on() { grep -l "going on after" "$@" >/dev/null 2>&1; }
# Processes of this script's relt that render in this folder.
renders() {
    local pid
    for pid in $(pgrep -f "^$RELT render"); do [ "$(readlink "/proc/$pid/cwd")" = "$PWD" ] && echo "$pid"; done
    true
}
rendering() { [ "$(renders | wc -l)" -ge "$1" ]; }
none_rendering() { [ -z "$(renders)" ]; }
folder() { mkdir -p "$scratch/$1" && cd "$scratch/$1" || exit 1; say; say "== $1"; }
some_part() { ls image.*-of-$parts.part >/dev/null 2>&1; }

hyperqueue() {
    folder hyperqueue
    python3 -m venv venv && venv/bin/pip install -q 'hyperqueue==0.27.0' >pip.log 2>&1 || { say "skipped: see pip.log"; return; }
    cat >cluster.py <<'P'
import sys, time
from hyperqueue.cluster import LocalCluster, WorkerConfig
cluster = LocalCluster(server_dir=sys.argv[1], worker_config=WorkerConfig(cores=1))
cluster.start_worker(WorkerConfig(cores=1))
print("up", flush=True)
while True:
    time.sleep(1)
P
    cluster() { : >cluster.log; venv/bin/python cluster.py "$PWD/server" >cluster.log 2>&1 & server=$!; started+=("$server"); await grep -q '^up' cluster.log; }
    submit() { CHECKPOINT=1s venv/bin/python "$root/examples/cluster/hyperqueue_parts.py" "$PWD/server" $parts "$scene" image.exr "${job[@]}" >>submit.log 2>&1; }
    cluster
    holds "HyperQueue: parts by HQ_TASK_ID, threads by HQ_CPUS, merged by a last task: the bits of --parts $parts" \
        eval 'submit && same image.exr && grep -q "part 2 of 3 by HQ_TASK_ID 2" image.2.log && grep -q "1 thread$" image.2.log'

    rm -f image.*
    submit & local client=$!
    await rendering 1; await some_part
    kill -9 $(renders | head -1)
    wait $client
    holds "a task killed with kill -9: HyperQueue tells, and no image is made" eval '! [ -e image.exr ]'
    submit
    holds "submitted again: the part goes on from its checkpoint, same bits" eval 'same image.exr && went_on image.[1-3].log'

    rm -f image.*
    submit & client=$!
    await rendering 1; await some_part
    kill -9 "$server"; wait $client
    holds "server and workers killed with kill -9: the client tells" grep -qi -E "error|refused|closed|disconnect" submit.log
    sleep 1; say "        tasks that outlive their worker: $(renders | wc -l)"
    await none_rendering
    cluster
    submit
    holds "server and workers started again, same job: goes on, same bits" eval 'same image.exr && went_on image.[1-3].log'
    kill -9 "$server"
    cd "$scratch"
}

slurm() {
    folder slurm
    local tool; for tool in munged slurmctld slurmd sbatch; do command -v $tool >/dev/null || { say "skipped: no $tool"; return; }; done
    [ "$(id -u)" = 0 ] || { say "skipped: wants to be root"; return; }
    local node; node=$(hostname -s)
    mkdir state spool; mkdir -m 700 munge
    dd if=/dev/urandom bs=1 count=1024 of=munge/key 2>/dev/null; chmod 600 munge/key
    cat >slurm.conf <<C
ClusterName=one
SlurmctldHost=$node(127.0.0.1)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket=$PWD/munge/socket
CredType=cred/munge
SlurmctldPort=16817
SlurmdPort=16818
StateSaveLocation=$PWD/state
SlurmdSpoolDir=$PWD/spool
SlurmctldPidFile=$PWD/slurmctld.pid
SlurmdPidFile=$PWD/slurmd.pid
SlurmctldLogFile=$PWD/slurmctld.log
SlurmdLogFile=$PWD/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SwitchType=switch/none
MpiDefault=none
ReturnToService=2
SlurmctldTimeout=10
SlurmdTimeout=10
NodeName=$node NodeAddr=127.0.0.1 CPUs=2 State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
C
    export SLURM_CONF=$PWD/slurm.conf
    # in the foreground, so that they are ours to end
    munged --foreground --force --key-file="$PWD/munge/key" --socket="$PWD/munge/socket" --log-file="$PWD/munge/log" \
        --pid-file="$PWD/munge/pid" --seed-file="$PWD/munge/seed" >munged.log 2>&1 & started+=($!)
    await [ -S munge/socket ]
    local controller node_daemon
    slurmctld -D -f slurm.conf >controller.log 2>&1 & controller=$!; started+=($controller)
    sleep 2
    slurmd -D -f slurm.conf >node.log 2>&1 & node_daemon=$!; started+=($node_daemon)
    await eval 'sinfo -h -o %t 2>/dev/null | grep -q idle' || { say "skipped: the node does not come up, see slurmctld.log"; return; }
    local script=$root/examples/cluster/slurm-array.sbatch
    submit() { CHECKPOINT=1s sbatch --parsable --cpus-per-task=1 --time=10 -o task.%a.log "$@" "$script" "$scene" "$PWD/image.exr" "${job[@]}"; }
    over() { [ -z "$(squeue -h 2>/dev/null)" ]; }
    submit --array=1-$parts >id
    await over
    holds "SLURM: parts by the array, threads by its cores: the bits of --parts $parts" \
        eval 'merged && grep -q "part 2 of 3 by SLURM_ARRAY_TASK_ID 2" task.2.log && grep -q "1 thread$" task.2.log'

    rm -f image.* task.*
    submit --array=1-$parts >id
    await rendering 1; await some_part
    kill -9 $(renders) 2>/dev/null
    await over
    PARTS=$parts submit --array=1-$parts >id
    await over
    holds "tasks killed with kill -9, submitted again by their numbers: same bits" eval 'merged && went_on task.*.log'

    rm -f image.* task.*
    local id; id=$(submit --array=1-$parts)
    await rendering 1; await some_part
    # what SLURM does two minutes before the end of the time
    scancel --signal=USR2 --batch "${id}_1" >requeue.log 2>&1
    await grep -q interrupted task.1.log
    sleep 6 # the controller saves its state every five seconds
    kill -9 $controller; wait $controller 2>/dev/null
    slurmctld -D -f slurm.conf >controller.log 2>&1 & controller=$!; started+=($controller)
    await eval 'squeue -h >/dev/null 2>&1'
    # a requeued task waits for two minutes unless it is let go
    for _ in $(seq 60); do
        over && break
        scontrol update JobId="${id}_1" StartTime=now >>requeue.log 2>&1
        sleep 1
    done
    holds "a task near the end of its time requeues itself, and the controller is killed and started again: same bits" \
        eval 'merged && went_on task.1.log'
    cd "$scratch"
}

mpi() {
    folder mpi
    command -v mpirun >/dev/null || { say "skipped: no mpirun"; return; }
    local run=(mpirun --allow-run-as-root --oversubscribe --bind-to none)
    "${run[@]}" -n 2 "$RELT" render "$scene" "${job[@]}" --threads 1 -o probe.exr >probe.log 2>&1
    grep -q "on 2 ranks" probe.log || { say "skipped: $RELT is built without --features mpi"; return; }
    "$RELT" render "$scene" "${job[@]}" -o alone.exr >alone.log 2>&1
    equal() { "$RELT" compare --reference alone.exr "$1" 2>&1 | grep -q "^$1 *0 *0 *0 *1.0000 *0.0000"; }
    local ranks
    for ranks in 2 3 5; do
        "${run[@]}" -n $ranks "$RELT" render "$scene" "${job[@]}" --threads 1 -o ranks.exr >ranks.$ranks.log 2>&1
        holds "$ranks ranks: the bits of one process ($(grep -o 'rank 0 spent.*' ranks.$ranks.log))" equal ranks.exr
    done
    # more ranks than the eight blocks of this job: some share one, each with replicas of the same ladder
    local long=(-D res=32 --mpp 100 --replicas 64 --mapping unidirectional --seed 5)
    mv alone.exr short.exr
    "$RELT" render "$scene" "${long[@]}" -o alone.exr >long.log 2>&1
    "${run[@]}" -n 12 "$RELT" render "$scene" "${long[@]}" --threads 1 -o long.exr >ranks.12.log 2>&1
    holds "replicas of a ladder on two ranks (12 of them): the bits of one process ($(grep -o 'rank 0 spent.*' ranks.12.log))" \
        equal long.exr
    mv short.exr alone.exr
    "${run[@]}" -n 1 nice -n 19 "$RELT" render "$scene" "${job[@]}" --threads 1 -o slow.exr : \
        -n 1 "$RELT" render "$scene" "${job[@]}" --threads 2 -o slow.exr >slow.log 2>&1
    holds "ranks of different speed and threads: the same bits" equal slow.exr
    CHECK=(--checkpoint 1s --resume auto)
    "${run[@]}" -n 2 "$RELT" render "$scene" "${job[@]}" --threads 1 "${CHECK[@]}" -o killed.exr >killed.log 2>&1 &
    local job_pid=$!
    await [ -e killed.checkpoint ]
    kill -9 $(renders | tail -1); wait $job_pid
    say "        mpirun says: $(grep -m1 -i "signal 9" killed.log)"
    "${run[@]}" -n 3 "$RELT" render "$scene" "${job[@]}" --threads 1 "${CHECK[@]}" -o killed.exr >again.log 2>&1
    holds "a rank killed with kill -9, gone on with on 3 ranks: the same bits" eval 'equal killed.exr && went_on again.log'
    local mlt=(-D res=48 --mpp 300 --method mlt --mapping unidirectional --seed 5)
    "$RELT" render "$scene" "${mlt[@]}" -o alone.exr >alone.log 2>&1
    "${run[@]}" -n 3 "$RELT" render "$scene" "${mlt[@]}" --threads 1 -o mlt.exr >mlt.log 2>&1
    holds "mlt on 3 ranks: the bits of one process" eval 'grep -q "on 3 ranks" mlt.log && equal mlt.exr'
    cp ../whole.exr alone.exr
    "${run[@]}" -n 3 "$RELT" render "$scene" "${job[@]}" --parts $parts --threads 1 -o parts.exr >parts.log 2>&1
    holds "--parts $parts on 3 ranks: the bits of --parts $parts" eval 'grep -q "on 3 ranks" parts.log && equal parts.exr'
    cd "$scratch"
}

# Two hosts that are network namespaces, with a wire between them.
network() {
    folder network
    command -v mpirun >/dev/null || { say "skipped: no mpirun"; return; }
    local a=relt-a.$$ b=relt-b.$$ refused
    refused=$(ip netns add $a 2>&1 && ip netns add $b 2>&1) || { say "skipped: no network namespaces: $refused"; return; }
    hosts+=($a $b)
    ip link add wire netns $a type veth peer name wire netns $b || { say "skipped: no veth"; return; }
    ip -n $a addr add 10.9.0.1/24 dev wire; ip -n $b addr add 10.9.0.2/24 dev wire
    local host; for host in $a $b; do ip -n $host link set lo up; ip -n $host link set wire up; done
    # in the place of ssh: AGENT HOST COMMAND…
    printf '#!/bin/bash\nshift\nexec ip netns exec %s unshare --uts bash -c "hostname relt-b; $*"\n' $b >agent
    chmod +x agent
    local run=(mpirun --allow-run-as-root --oversubscribe --bind-to none --mca plm_rsh_agent "$PWD/agent" --mca btl tcp,self
        --mca btl_tcp_if_include 10.9.0.0/24 --mca oob_tcp_if_include 10.9.0.0/24 --mca oob_tcp_keepalive_time 2
        --mca oob_tcp_keepalive_intvl 1 --mca oob_tcp_keepalive_probes 3 --host 10.9.0.1,10.9.0.2 -n 2
        "$RELT" render "$scene" "${job[@]}" --threads 1 --checkpoint 1s --resume auto -o cut.exr)
    on_two_hosts() { ip netns exec $a unshare --uts bash -c 'hostname relt-a; exec "$@"' bash "${run[@]}"; }
    on_two_hosts >cut.log 2>&1 &
    local pid=$!
    await [ -e cut.checkpoint ] || { say "skipped: see cut.log"; return; }
    ip -n $a link set wire down
    local begin=$SECONDS
    wait $pid
    local code=$?
    say "        mpirun ends after $((SECONDS - begin)) s with $code: $(grep -m1 -i "lost communication" cut.log)"
    holds "the wire between two hosts is cut: both ends stop" eval '[ $code != 0 ] && ! [ -e cut.exr ] && await none_rendering'
    ip -n $a link set wire up
    on_two_hosts >again.log 2>&1
    "$RELT" render "$scene" "${job[@]}" -o alone.exr >alone.log 2>&1
    holds "mended, the same command goes on: the bits of one process" eval \
        '"$RELT" compare --reference alone.exr cut.exr 2>&1 | grep -q "^cut.exr *0 *0 *0 *1.0000 *0.0000" && went_on again.log'
    cd "$scratch"
}

faults() {
    folder faults
    local run=("$RELT" render "$scene" "${job[@]}" --checkpoint 1s --resume auto -o image.exr)
    "${run[@]}" --part 1/$parts >1.log 2>&1
    "${run[@]}" --part 2/$parts >2.log 2>&1
    "${run[@]}" --part 3/$parts >3.log 2>&1
    holds "parts without an engine: same bits" merged
    cp image.2-of-$parts.part.previous kept
    truncate -s -100 image.2-of-$parts.part
    "$RELT" merge image.*-of-$parts.part -o image.exr >merge.log 2>&1
    holds "of a part that is cut off the one before it is taken" grep -q "image.2-of-$parts.part.previous" merge.log
    rm image.2-of-$parts.part.previous
    "$RELT" merge image.*-of-$parts.part -o none.exr >merge.log 2>&1
    holds "and where there is none it is refused by its name" eval '! [ -e none.exr ] && grep -q "error: image.2-of" merge.log'
    say "        $(grep -m1 image.2 merge.log)"
    mv kept image.2-of-$parts.part.previous
    "${run[@]}" --part 2/$parts >2.log 2>&1
    holds "and made whole from the one before it" eval 'merged && went_on 2.log'

    rm -f image.*
    if mkdir -p "$scratch/small" && mount -t tmpfs -o size=200k tmpfs "$scratch/small" 2>/dev/null; then
        (cd "$scratch/small" && "${run[@]}" --part 2/$parts) >full.log 2>&1
        holds "a full disk is told of and ends with code 1" [ $? = 1 ]
        say "        $(grep -m1 warning full.log)"
        mount -o remount,size=20m "$scratch/small"
        (cd "$scratch/small" && "${run[@]}" --part 2/$parts) >room.log 2>&1
        cp "$scratch"/small/image.2-of-$parts.part .
        "${run[@]}" --part 1/$parts >1.log 2>&1
        "${run[@]}" --part 3/$parts >3.log 2>&1
        holds "with room again the same command makes the part: same bits" merged
    else
        say "skipped: no tmpfs"
    fi

    rm -f image.*
    if command -v faketime >/dev/null; then
        local library; library=$(ls /usr/lib/*/faketime/libfaketime.so.1 | head -1)
        # the clock of the day jumps back by a day amid the run; the monotonic one is the kernel's
        echo "+0" >time
        LD_PRELOAD=$library FAKETIME_TIMESTAMP_FILE=$PWD/time FAKETIME_NO_CACHE=1 FAKETIME_DONT_FAKE_MONOTONIC=1 \
            "${run[@]}" --part 2/$parts --log 2.jsonl >2.log 2>&1 &
        local pid=$!
        await [ -e image.2-of-$parts.part ]
        local before; before=$(grep -c '"checkpoint"' 2.jsonl)
        echo "-1d" >time
        wait $pid
        say "        checkpoints before the jump: $before, in all: $(grep -c '"checkpoint"' 2.jsonl)"
        "${run[@]}" --part 1/$parts >1.log 2>&1
        "${run[@]}" --part 3/$parts >3.log 2>&1
        holds "the clock jumps back by a day: checkpoints go on, same bits" eval "merged && [ $(grep -c '"checkpoint"' 2.jsonl) -gt $before ]"
    else
        say "skipped: no faketime"
    fi
    cd "$scratch"
}

cd "$scratch" || exit 1
"$RELT" render "$scene" "${job[@]}" --parts $parts -o whole.exr >whole.log 2>&1 || { cat whole.log; exit 1; }
for what in "${@:-hyperqueue slurm mpi network faults}"; do
    for one in $what; do "$one"; done
done
exit $failed
