#!/bin/sh
# Installs a package of isoshift in a fresh Debian 12 and uses it there: try.sh PACKAGE.deb. Needs root, debootstrap and a mirror.
set -eu
package=$(readlink -f "$1")
root=$(mktemp -d /var/tmp/isoshift-root-XXXXXX)
trap 'rm -rf "$root"' EXIT

debootstrap --variant=minbase bookworm "$root" >"$root.log" 2>&1 || { tail -n 20 "$root.log" >&2; exit 1; }
rm -f "$root.log"
cp "$package" "$root/isoshift.deb"
cp /etc/resolv.conf "$root/etc/resolv.conf"
inside() { chroot "$root" env DEBIAN_FRONTEND=noninteractive LC_ALL=C.UTF-8 "$@"; }
inside apt-get update -qq
inside apt-get install -y -qq --no-install-recommends man-db /isoshift.deb >/dev/null 2>&1
inside isoshift --version
inside man isoshift-register | head -n 4
inside isoshift phantom -o /demo/study
inside isoshift register /demo/study -o /demo/result --truth /demo/study/truth.json
