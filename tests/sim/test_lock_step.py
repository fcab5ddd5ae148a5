"""Who waits for whom in lock-step."""

from sim_bridge.ros.lock_step import LockStepServer


def test_time_runs_until_somebody_answers_for_the_first_time():
    lock = LockStepServer()
    lock.ask(1, 1)
    assert not lock.stands
    lock.answer(0, False)  # to a moment that is over: but somebody hears
    assert lock.stands
    lock.answer(1, False)
    assert not lock.stands


def test_time_stands_at_every_moment_until_that_moment_is_answered():
    lock = LockStepServer()
    lock.answer(0, False)
    for moment in (1, 2, 3):
        lock.ask(moment, 1)
        lock.answer(moment - 1, False)
        assert lock.stands
        lock.answer(moment, False)
        assert not lock.stands


def test_idle_policy_lets_time_stand_until_it_takes_the_moment_up():
    lock = LockStepServer()
    lock.ask(1, 1)
    lock.answer(1, True)
    assert lock.stands
    lock.answer(1, False)
    assert not lock.stands


def test_start_is_greeted_at_the_first_moment_that_is_answered_from_then_on():
    lock, greeted = LockStepServer(), []
    lock.ask(1, 1)
    lock.answer(1, True)
    lock.begin(lambda: greeted.append("a"))
    assert not lock.stands
    lock.answer(1, False)
    assert greeted == []
    lock.ask(2, 1)
    lock.answer(2, True)
    assert greeted == ["a"]
    lock.answer(2, False)
    lock.begin(lambda: greeted.append("b"))
    lock.ask(3, 0)  # nobody is there to wait for
    assert greeted == ["a", "b"]
