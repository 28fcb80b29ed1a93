# make demo   a minute of live scanning by a virtual scanner; leaves a recording and clouds
# make test   every check a change must pass
# make setup  what both need from the system; each installs its part itself

# A toolchain just installed by rustup is not yet on the PATH of this shell.
export PATH := $(PATH):$(HOME)/.cargo/bin

.PHONY: demo test setup

demo:
	@scripts/setup.sh
	@scripts/demo.sh

test: setup
	@scripts/test.sh

setup:
	@scripts/setup.sh test
