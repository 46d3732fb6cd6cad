#!/bin/bash
# Installs the packages of isoshift in a fresh Debian and uses them there: try.sh 12|13 [PACKAGE.deb]. Without a package, what is
# committed goes through ./dev demo in a fresh Debian of that release, and the package is made there; it is kept in
# build/debian-RELEASE. Needs root, debootstrap and a mirror.
set -euo pipefail
cd "$(dirname "$(readlink -f "$0")")/.."
release=$1 package=${2:-}
case $release in
  12) codename=bookworm ;;
  13) codename=trixie ;;
  *) echo "error: try.sh $release: expected 12 or 13, a release of Debian" >&2; exit 2 ;;
esac

root=
remove_root() {
  [ -n "$root" ] || return 0
  umount "$root/proc" 2>/dev/null || true
  rm -rf --one-file-system "$root"
}
trap remove_root EXIT
fresh_debian() {
  remove_root
  root=$(mktemp -d /var/tmp/isoshift-root-XXXXXX)
  debootstrap --variant=minbase "$codename" "$root" >"$root.log" 2>&1 || { tail -n 20 "$root.log" >&2; rm "$root.log"; exit 1; }
  rm -f "$root.log"
  chmod 755 "$root"  # apt downloads as a user of its own
  cp /etc/resolv.conf "$root/etc/resolv.conf"
  mount -t proc proc "$root/proc"  # bash in ./dev reads from /dev/fd
}
inside() { chroot "$root" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root DEBIAN_FRONTEND=noninteractive LC_ALL=C.UTF-8 "$@"; }
install_inside() {
  inside apt-get install -y -qq --no-install-recommends "$@" >"$root/apt.log" 2>&1 || { tail -n 20 "$root/apt.log" >&2; exit 1; }
}

if [ -z "$package" ]; then
  fresh_debian
  git clone -q . "$root/src"
  inside bash -c 'cd /src && time ./dev demo'
  inside bash -c 'cd /src && apt-get install -y -qq --no-install-recommends $(for section in python package; do packaging/packages.sh "$0" $section | cut -f 1; done) &&
    cmake --preset package >/dev/null && cmake --build --preset package && cd build/package && cpack' "$release"
  mkdir -p "build/debian-$release"
  cp "$root"/src/build/package/*.deb "build/debian-$release"
  package=$(ls -t "build/debian-$release"/isoshift_*.deb | head -n 1)
fi

fresh_debian
cp "$package" "$root/isoshift.deb"
cp "$(dirname "$package")"/python3-isoshift_*.deb "$root/python3-isoshift.deb"
inside apt-get update -qq
install_inside man-db /isoshift.deb /python3-isoshift.deb
inside isoshift --version
inside man isoshift-register | head -n 4
inside isoshift phantom -o /demo/study
inside isoshift register /demo/study -o /demo/result --truth /demo/study/truth.json
inside python3 /usr/share/doc/python3-isoshift/examples/register.py /demo/study

# Another program, with the libraries.
cp "$(dirname "$package")"/libisoshift-dev_*.deb "$root/libisoshift-dev.deb"
cp -r tests/consumer "$root/consumer"
install_inside cmake g++ ninja-build /libisoshift-dev.deb
inside cmake -S /consumer -B /consumer/build -G Ninja -DCMAKE_BUILD_TYPE=Release >/dev/null
inside cmake --build /consumer/build
inside /consumer/build/consumer /demo/study /demo/object.dcm
inside isoshift check /demo/object.dcm --plan /demo/study/RTPLAN.dcm
