#!/bin/sh
# Check the system packages; install what is missing when root, else name it in one message.
set -eu
list="$(dirname "$0")/system-packages.txt"
python="${1:-python3}"

present() {
    case "$1" in
        bin:*) command -v "${1#bin:}" >/dev/null 2>&1 ;;
        lib:*) "$python" -c "import ctypes, sys; ctypes.CDLL(sys.argv[1])" "${1#lib:}" >/dev/null 2>&1 ;;
        python:*) "$python" -c "import ${1#python:}" >/dev/null 2>&1 ;;
    esac
}

missing=""
while read -r package probe; do
    case "$package" in "" | "#"*) continue ;; esac
    present "$probe" || missing="$missing $package"
done <"$list"

[ -n "$missing" ] || exit 0
if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null 2>&1; then
    echo "installing system packages:$missing"
    apt-get update -qq
    # shellcheck disable=SC2086  # a list of packages
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $missing >/dev/null
else
    echo "System packages are missing:$missing" >&2
    echo "Fix: sudo apt-get install$missing   (then run make again)" >&2
    exit 1
fi
