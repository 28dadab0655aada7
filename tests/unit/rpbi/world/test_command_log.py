"""What is kept of the commands that entered a world."""

from rpbi.world.saved.command_log import MAX_KEPT, CommandLog, WorldCommand


def _log(count):
    log = CommandLog()
    for index in range(count):
        log.note(WorldCommand(index, "body", "input", index))
    return log


def test_commands_are_returned_from_an_index_on():
    first, commands = _log(10).since(7)
    assert first == 7
    assert [command.value for command in commands] == [7, 8, 9]
    assert _log(10).since(10) == (10, ())


def test_at_most_the_requested_number_of_commands_is_returned():
    first, commands = _log(10).since(2, most=3)
    assert (first, [command.value for command in commands]) == (2, [2, 3, 4])


def test_the_oldest_are_forgotten_and_that_shows():
    log = _log(MAX_KEPT + 5)
    first, commands = log.since(0)
    assert (first, len(commands), log.count) == (5, MAX_KEPT, MAX_KEPT + 5)
    assert commands[0].value == 5 and commands[-1].value == MAX_KEPT + 4


def test_it_begins_afresh():
    log = _log(10)
    log.clear()
    assert (log.count, log.since(0)) == (0, (0, ()))
