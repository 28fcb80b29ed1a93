# make demo   half a minute of live scanning by a virtual scanner; leaves a recording, clouds and a model
# make test   every check a change must pass
# make bench  how fast it is: every promised ratio beside its peers, and where the time goes (minutes)
# make setup  what these need from the system; each installs its part itself

# A toolchain just installed by rustup is not yet on the PATH of this shell.
export PATH := $(PATH):$(HOME)/.cargo/bin

.PHONY: demo test bench setup

demo:
	@scripts/setup.sh
	@scripts/demo.sh

bench:
	@scripts/setup.sh
	@scripts/bench.sh

test: setup
	@scripts/test.sh

setup:
	@scripts/setup.sh test
