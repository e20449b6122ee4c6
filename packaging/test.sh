#!/bin/sh
# Builds the Debian package, installs it, starts what its unit starts, stops it and removes it. As root on Debian, with cargo-deb; where
# systemd does not run, the unit is only verified, and its command is run by hand as the package's user.
#   packaging/test.sh [PROFILE]     (release, or dev for a quicker build)
set -eu
cd "$(dirname "$0")/.."
profile=${1:-release}
say() { printf '\n== %s\n' "$*"; }

say "the package"
if [ "$profile" = dev ]; then cargo build; cargo deb --no-build --profile dev --no-strip -o target/kort.deb
else cargo deb -o target/kort.deb; fi
dpkg-deb --info target/kort.deb | sed -n '/Package/,$p'
dpkg-deb --info target/kort.deb conffiles

say "installed"
apt-get install -y -qq ./target/kort.deb
getent passwd kort
systemd-analyze verify kort.service && echo "the unit is sound"

if [ -d /run/systemd/system ]; then
  say "started and stopped by systemd"
  systemctl start kort
  curl -fsS http://127.0.0.1:8080/healthz
  systemctl stop kort
else
  say "systemd does not run here: the unit's command by hand, as its user"
  install -d -o kort -g kort -m 750 /var/lib/kort /run/kort
  rights='prlimit --rtprio=90 --memlock=unlimited'
  $rights true 2>/dev/null || { rights=''; echo 'nor may anybody raise limits here: it runs without its real-time rights'; }
  as_kort() { cd /var/lib/kort && exec $rights setpriv --reuid=kort --regid=kort --init-groups "$@"; }
  (as_kort /usr/bin/kort check /etc/kort/kort.toml)
  (as_kort /usr/bin/kort up --config /etc/kort/kort.toml --root /run/kort/shm) &
  kort=$!
  for _ in $(seq 50); do curl -fsS http://127.0.0.1:8080/healthz 2>/dev/null && break; sleep 0.2; done
  curl -fsS http://127.0.0.1:8080/v1/thrusters/t1 | head -c 200; echo
  kill -TERM "$kort"
  wait "$kort"
fi
ls -ld /var/lib/kort/*
test -e /run/kort/shm.watched   # what stood latched is there for the next start

say "removed, then purged"
apt-get remove -y -qq kort
test ! -e /usr/bin/kort && test -e /etc/kort/kort.toml && test -d /var/lib/kort
apt-get purge -y -qq kort
test ! -e /etc/kort && test ! -e /var/lib/kort && test ! -e /run/kort
echo "nothing is left but the user"
