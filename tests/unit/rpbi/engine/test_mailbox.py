"""Notes to the simulation thread."""

import threading

import pytest
from tries import tries

from custom_ros_tools.errors import InterfaceError
from rpbi.engine.mailbox import ClosedError, Mailbox


def test_newest_value_of_a_slot_wins_and_is_taken_once():
    mailbox = Mailbox()
    mailbox.put("a", 1)
    mailbox.put("a", 2)
    mailbox.put("b", 3)
    assert dict(mailbox.drain()) == {"a": 2, "b": 3}
    assert dict(mailbox.drain()) == {}


def test_values_drained_from_an_empty_mailbox_stay_empty():
    mailbox = Mailbox()
    taken = mailbox.drain()
    mailbox.put("a", 1)
    assert dict(taken) == {}
    assert dict(mailbox.drain()) == {"a": 1}


def test_partial_values_that_wait_are_merged():
    mailbox = Mailbox()
    mailbox.put("target", {1: 0.1, 2: 0.2}, dict.__or__)
    mailbox.put("target", {2: 0.5}, dict.__or__)
    assert dict(mailbox.drain()) == {"target": {1: 0.1, 2: 0.5}}


def test_request_runs_in_the_thread_that_runs_requests():
    mailbox = Mailbox()
    future = mailbox.request(threading.get_ident)
    assert not future.done()
    runner = threading.Thread(target=mailbox.run_requests)
    runner.start()
    runner.join(60.0)
    assert future.result(0) == runner.ident


def test_a_busy_world_drops_values_and_refuses_requests():
    mailbox = Mailbox()
    mailbox.put("a", 1)
    mailbox.hold(lambda: "busy")
    mailbox.put("a", 2)
    refused, made = mailbox.request(lambda: 1), mailbox.request(lambda: 2, even_if_busy=True)
    mailbox.run_requests()
    with pytest.raises(InterfaceError, match="busy"):
        refused.result(0)
    assert made.result(0) == 2
    mailbox.hold(None)
    assert dict(mailbox.drain()) == {}
    mailbox.put("a", 3)
    assert dict(mailbox.drain()) == {"a": 3}


def test_request_that_raises_passes_its_error_and_the_next_runs():
    mailbox = Mailbox()
    bad = mailbox.request(lambda: 1 / 0)
    good = mailbox.request(lambda: "fine")
    mailbox.run_requests()
    with pytest.raises(ZeroDivisionError):
        bad.result(0)
    assert good.result(0) == "fine"


def test_a_request_given_up_before_its_turn_is_not_made():
    mailbox = Mailbox()
    made = []
    future = mailbox.request(lambda: made.append(1))
    assert future.cancel()
    mailbox.run_requests()
    assert made == []


def test_request_made_by_a_request_waits_for_the_next_turn():
    mailbox = Mailbox()
    made = []
    mailbox.request(lambda: mailbox.request(lambda: made.append(1)))
    mailbox.run_requests()
    assert made == []
    mailbox.run_requests()
    assert made == [1]


def test_closing_fails_those_that_wait_and_those_that_come():
    mailbox = Mailbox()
    waiting = mailbox.request(lambda: 1)
    mailbox.close()
    for future in (waiting, mailbox.request(lambda: 2)):
        with pytest.raises(ClosedError):
            future.result(0)


def test_many_threads_lose_no_request_and_keep_the_newest_value():
    mailbox = Mailbox()
    count, made = 500, []

    def ask(number):
        for turn in range(count):
            mailbox.put(f"slot{number}", turn)
            mailbox.request(lambda: made.append(1))

    threads = [threading.Thread(target=ask, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for _ in tries("all have asked"):
        mailbox.run_requests()
        if not any(thread.is_alive() for thread in threads):
            break
    mailbox.run_requests()
    assert len(made) == 4 * count
    taken = mailbox.drain()
    assert {taken.get(f"slot{number}") for number in range(4)} == {count - 1}


def test_drop_discards_waiting_values_and_those_of_earlier_generations():
    mailbox = Mailbox()
    generation = mailbox.generation
    mailbox.put("kuka/target", 1)
    mailbox.drop()
    mailbox.put("kuka/target", 2, generation=generation)
    assert dict(mailbox.drain()) == {}
    mailbox.put("kuka/target", 3, generation=mailbox.generation)
    assert dict(mailbox.drain()) == {"kuka/target": 3}
