"""A signal ends a client wherever it arrives."""

import os
import signal

import pytest
from cfnav_ros.process.stop_signal import StopSignal

from cfnav_core.command.interrupt import Interrupt, ending_signals

ALL = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@pytest.fixture
def terminal():
    """As in a terminal, whatever the tests were started by, ``nohup`` or another test."""
    before = [signal.signal(number, signal.SIG_DFL) for number in ALL]
    yield
    for number, handler in zip(ALL, before, strict=True):
        signal.signal(number, handler)


@pytest.fixture
def interrupt(terminal):
    caught = Interrupt()
    caught.catch()
    return caught


@pytest.mark.parametrize("number", ALL)
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


def test_a_node_ends_with_its_terminal_unless_nohup_says_no(terminal):
    stop = StopSignal()
    assert not stop
    os.kill(os.getpid(), signal.SIGHUP)
    assert stop
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    assert signal.SIGHUP not in ending_signals()
    stop = StopSignal()
    os.kill(os.getpid(), signal.SIGHUP)
    assert not stop
