#!/usr/bin/env bash
# A Slurm cluster of several nodes on one computer, started by hand on loopback and stopped again, for tests.
set -euo pipefail

usage() {
  cat <<'TEXT'
usage: slurm/test/cluster.sh up FOLDER [--nodes N] [--cpus N] | lose FOLDER NAME | down FOLDER

  up     writes a configuration into FOLDER and starts munged, slurmctld and N times slurmd (3 nodes of 2 processors):
         export SLURM_CONF=FOLDER/slurm.conf, and sbatch, squeue and the others talk to it
  lose   kills slurmd and slurmstepd of a node as a crash would, leaves what they started running, and prints the ids
         of those processes
  down   stops everything that `up` and the cluster's jobs started
Exit code 69 when Slurm is not installed; with KARST_TEST_INSTALL=1 `up` installs it with apt.
TEXT
}

fail() {
  printf 'error: %s\n' "$1" >&2
  exit "${2:-1}"
}

# The daemons stand where an ordinary account does not look.
PATH="$PATH:/usr/sbin:/sbin"

needed="munged slurmctld slurmd sbatch squeue scontrol scancel"
is_installed() {
  local program
  for program in $needed; do command -v "$program" >/dev/null || return 1; done
}

install_slurm() {
  ! is_installed || return 0
  if [ "${KARST_TEST_INSTALL:-}" != 1 ] || [ "$(id -u)" != 0 ] || ! command -v apt-get >/dev/null; then
    fail "Slurm is not installed: apt-get install -y --no-install-recommends slurm-wlm munge" 69
  fi
  printf '== install: Slurm\n' >&2
  apt-get -o DPkg::Lock::Timeout=300 update -qq
  DEBIAN_FRONTEND=noninteractive apt-get -o DPkg::Lock::Timeout=300 install -y -qq --no-install-recommends \
    slurm-wlm munge >/dev/null
  is_installed || fail "Slurm was installed, but one of these is missing: $needed"
}

# free_ports N: the first of N ports in a row on which nobody listens.
free_ports() {
  python3 - "$1" <<'PYTHON'
import random, socket, sys
count = int(sys.argv[1])
for _ in range(200):
    first, held = random.randrange(20000, 32000), []
    try:
        for port in range(first, first + count):
            held.append(socket.socket())
            held[-1].setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            held[-1].bind(("127.0.0.1", port))
    except OSError:
        continue
    finally:
        for one in held:
            one.close()
    print(first)
    sys.exit()
sys.exit("no free ports in a row")
PYTHON
}

write_configuration() {
  local folder="$1" nodes="$2" cpus="$3" port host user
  port="$(free_ports $((nodes + 1)))"
  host="$(hostname -s)"
  user="$(id -un)"
  cat >"$folder/slurm.conf" <<CONF
ClusterName=karst-test
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=$port
SlurmUser=$user
SlurmdUser=$user
AuthType=auth/munge
AuthInfo=socket=$folder/run/munge.sock,cred_expire=5
CredType=cred/munge
CommunicationParameters=NoCtldInAddrAny,NoInAddrAny
SlurmctldPidFile=$folder/run/slurmctld.pid
SlurmdPidFile=$folder/run/slurmd-%n.pid
SlurmctldLogFile=$folder/log/slurmctld.log
SlurmdLogFile=$folder/log/slurmd-%n.log
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool/%n
SlurmdParameters=config_overrides
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
JobCompType=jobcomp/filetxt
JobCompLoc=$folder/log/finished.txt
MpiDefault=none
SwitchType=switch/none
ReturnToService=2
SchedulerType=sched/backfill
SchedulerParameters=sched_interval=1,bf_interval=1,batch_sched_delay=0
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
PreemptType=preempt/partition_prio
PreemptMode=REQUEUE
JobRequeue=1
KillWait=5
InactiveLimit=0
MinJobAge=600
MaxArraySize=101
SlurmctldTimeout=30
SlurmdTimeout=12
NodeName=n[1-$nodes] NodeHostname=$host NodeAddr=127.0.0.1 Port=[$((port + 1))-$((port + nodes))] CPUs=$cpus RealMemory=1000 State=UNKNOWN
PartitionName=batch Nodes=ALL Default=YES MaxTime=1:00:00 PriorityTier=1 GraceTime=8 PreemptMode=REQUEUE State=UP
PartitionName=urgent Nodes=ALL MaxTime=1:00:00 PriorityTier=10 PreemptMode=OFF State=UP
CONF
}

up() {
  local folder="$1" nodes="$2" cpus="$3" node
  install_slurm
  mkdir -p "$folder"/{run,log,state,spool}
  chmod 0755 "$folder" "$folder"/*
  (umask 077 && head -c 1024 /dev/urandom >"$folder/munge.key")
  write_configuration "$folder" "$nodes" "$cpus"
  munged --force --key-file="$folder/munge.key" --socket="$folder/run/munge.sock" --pid-file="$folder/run/munged.pid" \
    --log-file="$folder/log/munged.log" --seed-file="$folder/run/munge.seed" --num-threads=2
  slurmctld -f "$folder/slurm.conf" -c
  for node in $(seq "$nodes"); do slurmd -f "$folder/slurm.conf" -N "n$node" -c; done
  export SLURM_CONF="$folder/slurm.conf"
  for _ in $(seq 150); do
    [ "$(sinfo -h -N -p batch -t idle -o %N 2>/dev/null | wc -l)" != "$nodes" ] || return 0
    sleep 0.2
  done
  sinfo -N -l >&2 || :
  fail "not every node came up; the logs are in $folder/log"
}

# is_gone PID: it has ended, whether or not somebody has looked after it.
is_gone() { [ ! -d "/proc/$1" ] || grep -q '^State:.*Z' "/proc/$1/status" 2>/dev/null; }

# of_cluster FOLDER PID VARIABLE: whether a process was started in this cluster, with this variable set.
of_cluster() {
  # The shell itself complains of a process that has ended meanwhile.
  { tr '\0' '\n' <"/proc/$2/environ"; } 2>/dev/null |
    awk -v conf="SLURM_CONF=$1/slurm.conf" -v name="$3=" '$0 == conf { a = 1 } index($0, name) == 1 { b = 1 } END { exit !(a && b) }'
}

lose() {
  local folder="$1" node="$2" job jobs entry
  export SLURM_CONF="$folder/slurm.conf"
  # The daemon of a step calls itself `slurmstepd: [JOB.batch]`.
  jobs="$(squeue -h -w "$node" -t RUNNING -o %A)"
  for job in $jobs; do
    for entry in /proc/[0-9]*; do
      [[ "$({ tr '\0' ' ' <"$entry/cmdline"; } 2>/dev/null)" != "slurmstepd: [$job."* ]] ||
        ! of_cluster "$folder" "${entry#/proc/}" SLURM_CONF || kill -9 "${entry#/proc/}"
    done
  done
  kill -9 "$(cat "$folder/run/slurmd-$node.pid")"
  for entry in /proc/[0-9]*; do
    ! of_cluster "$folder" "${entry#/proc/}" SLURM_JOB_ID || printf '%s\n' "${entry#/proc/}"
  done
}

down() {
  local folder="$1" file pid entry
  export SLURM_CONF="$folder/slurm.conf"
  # Those whose time is over do not stop the others from being ended.
  timeout 10 scancel --user="$(id -un)" 2>/dev/null || :
  for _ in $(seq 50); do
    [ -n "$(timeout 5 squeue -h -t RUNNING,COMPLETING 2>/dev/null)" ] || break
    sleep 0.2
  done
  for file in "$folder"/run/slurmd-*.pid "$folder/run/slurmctld.pid" "$folder/run/munged.pid"; do
    [ -f "$file" ] || continue
    pid="$(cat "$file")"
    ! is_gone "$pid" || continue
    kill "$pid"
    for _ in $(seq 50); do ! is_gone "$pid" || break; sleep 0.1; done
    is_gone "$pid" || kill -9 "$pid"
  done
  # What a lost node left running.
  for entry in /proc/[0-9]*; do
    ! of_cluster "$folder" "${entry#/proc/}" SLURM_JOB_ID || kill -9 "${entry#/proc/}" 2>/dev/null || :
  done
}

nodes=3 cpus=2 rest=()
while [ $# -gt 0 ]; do
  case "$1" in
    --nodes) nodes="${2:?--nodes N}" && shift 2 ;;
    --cpus) cpus="${2:?--cpus N}" && shift 2 ;;
    -h | --help) usage && exit 0 ;;
    *) rest+=("$1") && shift ;;
  esac
done
case "${rest[*]:0:1} ${#rest[@]}" in
  "up 2") mkdir -p "${rest[1]}" && up "$(realpath "${rest[1]}")" "$nodes" "$cpus" ;;
  "lose 3") lose "$(realpath "${rest[1]}")" "${rest[2]}" ;;
  "down 2") down "$(realpath "${rest[1]}")" ;;
  *) usage >&2 && fail "${rest[*]:-nothing}: not understood" 64 ;;
esac
