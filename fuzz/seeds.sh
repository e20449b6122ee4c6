#!/bin/sh
# Folders of seeds of a fuzz target: its own, or the shipped files of that kind.
case $1 in
  csv | mcap | bodies | messages | wires) echo "fuzz/seeds/$1" ;;
  toml) echo config/thrusters config/scenarios config/controllers config/columns ;;
  deployment) echo config ;;
  *) echo "no target $1" >&2; exit 2 ;;
esac
