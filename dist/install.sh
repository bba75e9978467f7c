#!/bin/sh
# Links pdk into a folder of the PATH: ./install [FOLDER], by default ~/.local/bin.
# To uninstall it, remove the link and the folder that this file lies in.
set -eu

fail() {
	echo "install: $1" >&2
	exit 1
}

here=$(CDPATH='' cd -- "$(dirname -- "$0")" && pwd -P)
system="$(uname -s) $(uname -m)"
[ "$system" = "Linux {{machine}}" ] || fail "this archive is for Linux on {{machine}}, and this is $system; take the archive for it"

# Only glibc answers with its version.
glibc=$(getconf GNU_LIBC_VERSION 2>/dev/null || true)
glibc=${glibc#glibc }
case $glibc in
	[0-9]*.[0-9]*) ;;
	*) fail "pdk needs glibc {{glibc}} or newer, and this system has another C library, such as the musl of Alpine; use a container with Debian" ;;
esac
needed={{glibc}}
minor=${glibc#*.}
minor=${minor%%.*}
if [ "${glibc%%.*}" -lt "${needed%%.*}" ] || { [ "${glibc%%.*}" -eq "${needed%%.*}" ] && [ "$minor" -lt "${needed#*.}" ]; }; then
	fail "pdk needs glibc $needed or newer, and this system has $glibc; use a newer one, or a container with Debian"
fi

bin=${1:-${HOME:?name a folder of the PATH}/.local/bin}
mkdir -p -- "$bin"
ln -sf -- "$here/bin/pdk" "$bin/pdk"
"$bin/pdk" --version
case ":$PATH:" in
	*":$bin:"*) ;;
	*) echo "pdk is in $bin, which is not in the PATH; add it, or call $bin/pdk" ;;
esac
