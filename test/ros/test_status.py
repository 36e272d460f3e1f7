"""The status line on a terminal, in a file, and into a pipe that nobody reads."""

import os
import pty
import re

from alf_ros.ros.terminal import StatusLine


def test_a_terminal_gets_one_live_line_that_messages_do_not_break():
    terminal, end = pty.openpty()
    with os.fdopen(end, 'w') as stream:
        status = StatusLine(stream=stream)
        assert status.live
        for text in ('one', 'two'):
            status.show(text)
        status.say('done')
        status.say('bye')
        seen = ''
        while 'bye\r\n' not in seen:  # a terminal hands on what it has so far
            seen += os.read(terminal, 1000).decode()
    os.close(terminal)
    assert seen == '\r\x1b[Kone\r\x1b[Ktwo\r\x1b[Kdone\r\nbye\r\n'


def test_a_file_gets_plain_lines(tmp_path):
    with open(tmp_path / 'out', 'w') as stream:
        status = StatusLine(stream=stream)
        status.say('start')
        status.show('t 1 s')
        status.enabled = False
        status.show('t 2 s')
    assert (tmp_path / 'out').read_text() == 'start\nt 1 s\n'


def test_a_reader_that_goes_away_stops_the_lines_only():
    reader, writer = os.pipe()
    stream = os.fdopen(writer, 'w')
    status = StatusLine(stream=stream)
    os.close(reader)
    status.say('nobody')
    status.show('hears this')
    os.dup2(os.open(os.devnull, os.O_WRONLY), writer)  # what is buffered has somewhere to go
    stream.close()


def test_what_takes_long_is_announced_once(tmp_path):
    with open(tmp_path / 'out', 'w') as stream:
        status = StatusLine(stream=stream)
        with status.say_if_slow(lambda: 'compiling', 10.0):
            pass
        with status.say_if_slow(lambda: 'slow', 0.0):
            while 'slow' not in (tmp_path / 'out').read_text():
                pass
    assert (tmp_path / 'out').read_text() == 'slow\n'


def test_on_a_terminal_it_shows_that_time_goes_by():
    terminal, end = pty.openpty()
    seen = ''
    with os.fdopen(end, 'w') as stream:
        status = StatusLine(stream=stream)
        with status.say_if_slow(lambda: 'compiling ...', 0.0):
            while seen.count('compiling') < 3:
                seen += os.read(terminal, 1000).decode()
        while '\n' not in seen:
            seen += os.read(terminal, 1000).decode()
    os.close(terminal)
    assert re.fullmatch(r'(\r\x1b\[Kcompiling \.\.\. \d+ s){3,}\r\n', seen)
