"""A signal ends a client wherever it arrives."""

import os
import signal

import pytest

from cfnav_core.command.interrupt import Interrupt


@pytest.fixture
def interrupt():
    before = [signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM)]
    caught = Interrupt()
    caught.catch()
    yield caught
    for number, handler in zip((signal.SIGINT, signal.SIGTERM), before, strict=True):
        signal.signal(number, handler)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_is_a_keyboard_interrupt_once(interrupt, number):
    interrupt.check()
    with pytest.raises(KeyboardInterrupt):
        os.kill(os.getpid(), number)
    os.kill(os.getpid(), signal.SIGINT)  # clean-up goes on undisturbed
    os.kill(os.getpid(), signal.SIGTERM)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_an_interrupt_that_is_swallowed_comes_back(interrupt):
    class Careless:
        def __del__(self):
            os.kill(os.getpid(), signal.SIGINT)

    Careless()  # Python prints what a destructor raises, and goes on
    with pytest.raises(KeyboardInterrupt):
        interrupt.check()
