#!/bin/bash
# Prints the software bill of materials of isoshift as it would be built here, SPDX 2.3, tag-value: the packages of
# packages.txt, and those whose libraries PROGRAM loads. sbom.sh [PROGRAM=build/demo/cli/isoshift]
set -euo pipefail
cd "$(dirname "$(readlink -f "$0")")/.."
program=${1:-build/demo/cli/isoshift}
version=$(sed -n 's/^project(isoshift VERSION \([0-9.]*\).*/\1/p' CMakeLists.txt)
commit=$(git rev-parse --short=12 HEAD)
. /etc/os-release

cat <<END
SPDXVersion: SPDX-2.3
DataLicense: CC0-1.0
SPDXID: SPDXRef-DOCUMENT
DocumentName: isoshift-$version
DocumentNamespace: https://spdx.org/spdxdocs/isoshift-$version-$commit-$ID-$VERSION_ID
Creator: Tool: packaging/sbom.sh
Created: $(date -u +%FT%TZ)
Relationship: SPDXRef-DOCUMENT DESCRIBES SPDXRef-isoshift

PackageName: isoshift
SPDXID: SPDXRef-isoshift
PackageVersion: $version ($commit)
PackageDownloadLocation: NOASSERTION
FilesAnalyzed: false
PackageLicenseDeclared: Apache-2.0
END

declare -A is_told
# tell PACKAGE RELATIONSHIP REASON: the package as it is installed here, and what isoshift uses it for.
tell() {
  local package=$1 relationship=$2 id=SPDXRef-${1//[^A-Za-z0-9.-]/-} installed source
  installed=$(dpkg-query -W -f='${Version}' "$package" 2>/dev/null) || installed=
  [ -n "$installed" ] || { echo "sbom.sh: $package is not installed here: its version is not known" >&2; return 0; }
  if [ -z "${is_told[$package]:-}" ]; then
    is_told[$package]=1
    source=$(dpkg-query -W -f='${source:Package} ${source:Version}' "$package")
    cat <<END

PackageName: $package
SPDXID: $id
PackageVersion: $installed
PackageSupplier: Organization: Debian
PackageSourceInfo: built from the Debian source package $source
PackageDownloadLocation: NOASSERTION
FilesAnalyzed: false
PackageLicenseDeclared: NOASSERTION
PackageComment: <text>$3</text>
ExternalRef: PACKAGE-MANAGER purl pkg:deb/debian/$package@$installed?arch=$(dpkg --print-architecture)&distro=$ID-$VERSION_ID
END
  fi
  case $relationship in
    DEPENDS_ON | DYNAMIC_LINK) echo "Relationship: SPDXRef-isoshift $relationship $id" ;;
    *) echo "Relationship: $id $relationship SPDXRef-isoshift" ;;
  esac
}

# tell_section NAME RELATIONSHIP: the packages of a section of packages.txt.
tell_section() {
  while IFS=$'\t' read -r package reason; do tell "$package" "$2" "$reason"; done < <(packaging/packages.sh "$VERSION_ID" "$1")
}
tell_section run DEPENDS_ON
tell_section build BUILD_DEPENDENCY_OF
tell_section python BUILD_DEPENDENCY_OF
tell_section test TEST_DEPENDENCY_OF
[ -x "$program" ] || { echo "sbom.sh: $program: there is no such program: what it loads is not known" >&2; exit 0; }
ldd "$program" | awk '$2 == "=>" && $3 ~ /^\// {print $3; print "/usr" $3}' |
  { xargs dpkg-query -S 2>/dev/null || true; } | sed 's/:.*//' | sort -u |  # one of the two names is not known
  while read -r package; do tell "$package" DYNAMIC_LINK "a library that the program loads"; done
