#!/usr/bin/env bash
# Makes kernel and initramfs for the virtual machine: the kernel of this Debian release, and an initramfs with busybox,
# `init`, and the modules vivid and v4l2loopback with their dependencies. Downloads and unpacks packages, installs
# nothing, and needs no root.
# Usage: assets.sh FOLDER; prints the folder with `kernel` and `initramfs`. There is one for each version of the kernel
# and of this recipe; an existing one is reused.
set -euo pipefail
folder=$(realpath --canonicalize-missing "${1:?usage: assets.sh FOLDER}")
cd "$(dirname "$0")"

export PATH=$PATH:/usr/sbin:/sbin # for depmod; not in every user's PATH
readonly BOOT_MODULES=(virtio_pci 9pnet_virtio 9p) # loaded by init
readonly TEST_MODULES=(vivid videodev)             # init loads their dependencies, the tests load the drivers
readonly UNUSED=(drivers/net drivers/gpu drivers/infiniband drivers/scsi drivers/iio sound)
# Formats that the loopback driver lacks, and their bits per pixel. It carries the bytes of an image as they are.
readonly MORE_FORMATS=(
    "Y10 :16" "Y12 :16" "Y14 :16" "Y10P:10" "Y12P:12" "Y10B:10" "Y8I :16" "Y12I:24"
    "RGGB:8" "pRAA:10" "pgAA:10" "pGAA:10" "pBAA:10" "pRCC:12" "pgCC:12" "pGCC:12" "pBCC:12"
    "RG10:16" "BA10:16" "GB10:16" "BG10:16" "RG12:16" "BA12:16" "GB12:16" "BG12:16" "RG16:16" "GR16:16" "GB16:16" "BYR2:16"
    "XR24:32" "BX24:32" "XB24:32" "RX24:32"
)
recipe=$(cat assets.sh init | sha256sum | cut -c 1-8)

fail() {
    echo "assets.sh: $*" >&2
    exit 1
}

# Runs a command and prints its output only if it fails.
quietly() {
    "$@" >"$work/output.txt" 2>&1 || { cat "$work/output.txt" >&2; fail "failed: $*"; }
}

# Prints the version of the kernel; nothing if apt has no package lists.
kernel_version() {
    { apt-cache depends linux-image-amd64 2>/dev/null || true; } | sed -n 's/^ *Depends: linux-image-//p' | head -n 1
}

# Uses separate apt package lists. Those of the machine may be empty (in a fresh container) or too old, and only root
# can update them.
use_own_lists() {
    mkdir -p "$work/lists/partial"
    printf 'Dir::State::lists "%s";\nDir::Cache::pkgcache "";\nDir::Cache::srcpkgcache "";\n' "$work/lists" >"$work/apt.conf"
    export APT_CONFIG=$work/apt.conf
    # A failing source may not be needed. If it is, the download below fails.
    apt-get update -qq >"$work/output.txt" 2>&1 || cat "$work/output.txt" >&2
    version=$(kernel_version)
    [ -n "$version" ] || fail "apt knows no linux-image-amd64: the package sources need Debian's main archive"
}

download() {
    local headers
    headers=$(apt-cache depends "linux-headers-$version" | sed -En 's/^ *Depends: (linux-(headers|kbuild)-.*)/\1/p')
    rm -f "$work"/packages/*
    # shellcheck disable=SC2086 # several names
    (cd "$work/packages" && apt-get download -qq -o APT::Sandbox::User= \
        "linux-image-$version" "linux-headers-$version" $headers v4l2loopback-dkms busybox-static) >"$work/output.txt" 2>&1
}

unpack() {
    local package=$1
    shift
    dpkg-deb --fsys-tarfile "$work/packages/$package"_*.deb | tar --extract --directory "$work/root" "$@"
}

unpack_all() {
    local package
    unpack "linux-image-$version" "${UNUSED[@]/#/--exclude=*/kernel/}"
    for package in "$work"/packages/linux-{headers,kbuild}-*.deb "$work"/packages/{v4l2loopback-dkms,busybox-static}_*.deb; do
        package=${package##*/}
        unpack "${package%%_*}"
    done
    # If /lib is part of /usr.
    [ -e "$work/root/lib" ] || ln -s usr/lib "$work/root/lib"
}

# Prints an entry of the format table of the driver.
format_entry() {
    local code=${1%:*} bits=${1##*:}
    printf '{\n\t.name = "%s",\n\t.fourcc = v4l2_fourcc('"'%s', '%s', '%s', '%s'"'),\n\t.depth = %s,\n\t.flags = 0,\n},\n' \
        "$code" "${code:0:1}" "${code:1:1}" "${code:2:1}" "${code:3:1}" "$bits"
}

# Puts the missing formats at the head of the table.
add_formats() {
    local table=$1/v4l2loopback_formats.h format
    {
        for format in "${MORE_FORMATS[@]}"; do format_entry "$format"; done
        cat "$table"
    } >"$work/formats.h"
    mv "$work/formats.h" "$table"
}

build_v4l2loopback() {
    local source=("$work"/root/usr/src/v4l2loopback-*)
    local headers=$work/root/usr/src/linux-headers-$version
    sed -i "s#/usr/src/#$work/root/usr/src/#" "$headers/Makefile"
    add_formats "${source[0]}"
    quietly make -C "$headers" M="${source[0]}" CC=gcc CONFIG_DEBUG_INFO_BTF_MODULES= modules
    strip --strip-debug "${source[0]}/v4l2loopback.ko"
    cp "${source[0]}/v4l2loopback.ko" "$work/initramfs/modules/"
}

# Copies modules with their dependencies. Prints their files in load order.
copy_modules() {
    local verb path file
    printf '%s\n' "$@" | xargs -n 1 modprobe --dirname "$work/root" --set-version "$version" --show-depends |
        while read -r verb path _; do
            [ "$verb" = insmod ] || continue
            file=$(basename "${path%.xz}")
            [ ! -e "$work/initramfs/modules/$file" ] || continue
            case $path in
            *.xz) xz --decompress --stdout "$path" >"$work/initramfs/modules/$file" ;;
            *) cp "$path" "$work/initramfs/modules/$file" ;;
            esac
            echo "$file"
        done
}

make_initramfs() {
    mkdir -p "$work"/initramfs/{bin,dev,proc,sys,host,share,modules}
    find "$work/root" -path '*/bin/busybox' -exec cp {} "$work/initramfs/bin/" \;
    depmod --basedir "$work/root" "$version"
    {
        copy_modules "${BOOT_MODULES[@]}"
        copy_modules "${TEST_MODULES[@]}" | grep --invert-match '^vivid\.ko$'
    } >"$work/initramfs/boot_modules"
    build_v4l2loopback
    install init "$work/initramfs/init"
}

# Moves the result to its final folder only when complete, so an interrupted build leaves nothing that looks finished.
publish() {
    local made
    made=$(mktemp --directory "$folder/.made.XXXXXX")
    cp "$work/root/boot/vmlinuz-$version" "$made/kernel"
    (cd "$work/initramfs" && find . | cpio --quiet --create --format newc) >"$made/initramfs"
    mv --no-target-directory "$made" "$folder/$version-$recipe"
}

print_if_there() {
    [ ! -d "$folder/$version-$recipe" ] || { echo "$folder/$version-$recipe"; exit 0; }
}

if ! command -v apt-get >/dev/null || [ "$(dpkg --print-architecture)" != amd64 ]; then
    fail "the virtual machine needs a Debian kernel: run this test on Debian for amd64, 12 or later"
fi
mkdir -p "$folder"
# Several tests may run this at once: the first one builds, the others wait.
exec 9>"$folder/lock"
flock 9

version=$(kernel_version)
if [ -z "$version" ]; then
    # Without package lists, use the newest existing result.
    newest=$(find "$folder" -maxdepth 1 -name "[0-9]*-$recipe" | sort --version-sort | tail -n 1)
    [ -z "$newest" ] || { echo "$newest"; exit 0; }
fi
print_if_there
# Not inside the folder: its path may contain spaces, which the kernel's Makefile does not accept.
work=$(mktemp --directory)
trap 'rm -rf "$work"' EXIT
mkdir "$work"/{packages,root}
if [ -z "$version" ] || ! download; then
    use_own_lists
    print_if_there
    download || { cat "$work/output.txt" >&2; fail "cannot download the kernel $version; is there a network?"; }
fi
unpack_all
make_initramfs
publish
print_if_there
