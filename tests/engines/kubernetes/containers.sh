# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
#
# To be sourced: podman and buildah with a storage of their own in $work, with runc, and without
# cgroups that only systemd makes. Sets the functions `podman` and `buildah`, and `base_image`, which
# makes localhost/debian:12-slim by debootstrap, where no registry is reached.
mkdir -p "$work/containers"
cat > "$work/containers/containers.conf" <<'CONF'
[containers]
default_ulimits=["nofile=1024:1024","nproc=4096:4096"]
log_driver="k8s-file"
[engine]
cgroup_manager="cgroupfs"
events_logger="file"
runtime="runc"
CONF
cat > "$work/containers/storage.conf" <<CONF
[storage]
driver="vfs"
graphroot="$work/containers/root"
runroot="$work/containers/run"
CONF
if grep -qw overlay /proc/filesystems; then
  sed -i 's/"vfs"/"overlay"/' "$work/containers/storage.conf"
fi
export CONTAINERS_CONF=$work/containers/containers.conf
export CONTAINERS_STORAGE_CONF=$work/containers/storage.conf
podman() { command podman --cgroup-manager=cgroupfs --events-backend=file --runtime=runc "$@"; }
buildah() { command buildah "$@"; }

base_image() {
  podman image exists localhost/debian:12-slim && return
  local root=$work/base
  [ -e "$root/etc/debian_version" ] || debootstrap --variant=minbase bookworm "$root" \
    "${SHEAF_DEBIAN_MIRROR:-http://deb.debian.org/debian}" > "$work/debootstrap.log"
  # The "slim" images leave out these files.
  tar -C "$root" --exclude='./usr/share/doc/*' --exclude='./usr/share/man/*' \
    --exclude='./usr/share/locale/*' --exclude='./usr/share/info/*' \
    --exclude='./var/cache/apt/*' --exclude='./var/lib/apt/lists/*' --exclude='./dev/*' -c . |
    podman import - localhost/debian:12-slim > /dev/null
}
