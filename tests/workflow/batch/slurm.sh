#!/bin/sh
# Runs its arguments with a Slurm of its own: one machine, started before and stopped after. Needs root.
# Status 77: Slurm cannot be started here.
set -eu

[ "$(id -u)" = 0 ] && command -v slurmctld slurmd munged sbatch >/dev/null || exit 77
folder=$(mktemp -d /tmp/isoshift-slurm-XXXXXX)
cpus=$(nproc)
stop() {
  scancel --user=root 2>/dev/null || true
  for name in slurmctld slurmd munged; do
    [ ! -s "$folder/$name.pid" ] || kill "$(cat "$folder/$name.pid")" 2>/dev/null || true
  done
  sleep 1
  rm -rf "$folder"
}
trap stop EXIT

# munged wants to be the owner of its folder, and nobody else to be able to write on the way to it.
mkdir "$folder/munge" "$folder/state" "$folder/spool"
chmod 755 "$folder" "$folder/munge"
head -c 128 /dev/urandom >"$folder/munge/key"
chmod 400 "$folder/munge/key"
munged --force --socket="$folder/munge/socket" --key-file="$folder/munge/key" --log-file="$folder/munge/log" \
  --pid-file="$folder/munged.pid" --seed-file="$folder/munge/seed" || exit 77

cat >"$folder/slurm.conf" <<CONF
ClusterName=test
SlurmctldHost=$(hostname -s)(127.0.0.1)
AuthType=auth/munge
AuthInfo=socket=$folder/munge/socket
CredType=cred/munge
SlurmUser=root
SlurmctldPort=16817
SlurmdPort=16818
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.pid
SlurmctldLogFile=$folder/slurmctld.log
SlurmdLogFile=$folder/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
SwitchType=switch/none
MpiDefault=none
ReturnToService=2
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
NodeName=$(hostname -s) NodeAddr=127.0.0.1 CPUs=$cpus State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
CONF
export SLURM_CONF="$folder/slurm.conf"
slurmctld || exit 77
slurmd || { cat "$folder/slurmd.log" >&2; exit 77; }
n=0
until sinfo --noheader --format=%T 2>/dev/null | grep -q idle; do
  n=$((n + 1))
  [ $n -lt 60 ] || { cat "$folder/slurmctld.log" "$folder/slurmd.log" >&2; exit 77; }
  sleep 0.5
done

status=0
"$@" || status=$?
while [ -n "$(squeue --noheader 2>/dev/null)" ]; do sleep 0.5; done
exit $status
