#!/usr/bin/env bash
# Installs the build dependencies that are missing, with apt: a C compiler with its headers, libclang and git. With the
# argument `test` also Python, and the tools for the virtual machine of the V4L2 tests. Does not install Rust: if it is
# missing or too old, prints how to get it.
# Exit codes: 0 nothing is missing, 1 an installation failed, 2 something is missing that this script cannot or may not
# install.
set -euo pipefail
cd "$(dirname "$0")/.."

# Test for the presence of a package, and the package.
needed=(
    "command -v cc:build-essential" # the memory allocator, mimalloc, is C
    "command -v git:git"
    "has_libclang:libclang-dev" # iceoryx2 reads the system's C headers
)
[ "${1:-}" != test ] || needed+=(
    "python3 -c 'import ensurepip, venv':python3-venv" # tests read recordings from Python, as users do
    # The virtual machine of tests/v4l2: qemu runs it; the others find, build and pack its kernel modules and set up its
    # devices.
    "command -v qemu-system-x86_64:qemu-system-x86"
    "test -x /sbin/depmod:kmod"
    "command -v cpio:cpio"
    "command -v xz:xz-utils"
    "compgen -G '/usr/lib/*/libelf.so.1':libelf1"
    "command -v v4l2-ctl:v4l-utils"
    # Tests show patterns on a monitor that is not there.
    "command -v Xvfb:xvfb"
    # Tests open the dashboard in a browser.
    "command -v chromium:chromium"
    "compgen -G '/usr/share/fonts/truetype/*/*.ttf':fonts-dejavu-core"
)

# libclang-cpp.so, the C++ interface, does not count: bindgen cannot use it.
has_libclang() {
    compgen -G '/usr/lib/llvm-*/lib/libclang.so*' || compgen -G '/usr/lib/*/libclang.so*' ||
        compgen -G '/usr/lib/*/libclang-[0-9]*.so*' || [ -n "${LIBCLANG_PATH:-}" ]
}

missing_packages() {
    local entry
    for entry in "${needed[@]}"; do
        eval "${entry%:*}" >/dev/null 2>&1 || printf '%s\n' "${entry##*:}"
    done
}

# Sets the array `as_root` to the command prefix that gives the rights to install. Fails if there is none.
find_root() {
    as_root=()
    [ "$(id -u)" -eq 0 ] && return
    command -v sudo >/dev/null || return 1
    as_root=(sudo)
    # Without a terminal, nobody can type a password.
    [ -t 0 ] || as_root+=(--non-interactive)
    "${as_root[@]}" true
}

install_packages() {
    if ! command -v apt-get >/dev/null; then
        echo "setup: missing: $*; no apt-get: install the equivalents of these Debian packages, then try again" >&2
        exit 2
    fi
    if ! find_root; then
        echo "setup: missing: $*; installing needs root: run 'sudo apt-get install $*', then try again" >&2
        exit 2
    fi
    echo "setup: installing $*"
    "${as_root[@]}" apt-get update --quiet </dev/null
    "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
        apt-get install --yes --quiet --no-install-recommends "$@" </dev/null
}

check_rust() {
    local wanted found
    if ! command -v cargo >/dev/null; then
        echo "setup: cargo is missing: install Rust from https://rustup.rs, then try again" >&2
        exit 2
    fi
    wanted=$(sed -n 's/^rust-version = "\(.*\)"$/\1/p' Cargo.toml)
    found=$(rustc --version | cut -d ' ' -f 2)
    if [ "$(printf '%s\n' "$wanted" "$found" | sort --version-sort | head -n 1)" != "$wanted" ]; then
        echo "setup: Rust is $found, but at least $wanted is needed: run 'rustup update stable', then try again" >&2
        exit 2
    fi
}

mapfile -t missing < <(missing_packages)
[ "${#missing[@]}" -eq 0 ] || install_packages "${missing[@]}"
check_rust
