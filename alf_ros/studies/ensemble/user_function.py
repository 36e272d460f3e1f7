"""A function of the user that makes a number of a Run, and how it travels to workers."""

from __future__ import annotations

import base64
import hashlib
import pickle
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from alf_ros import paths
from alf_ros.effects.contract.user_file import LARGEST
from alf_ros.errors import InputError
from alf_ros.studies.ensemble.function_digest import function_digest, installed


@dataclass(frozen=True)
class UserFunction:
    """`source`: the text of a file and the name of a function in it; or `pickled`, of a function
    that was given itself. `digest` says which one it is."""

    name: str
    source: str = ''
    pickled: str = ''  # base64

    @classmethod
    def of(cls, given: Any) -> UserFunction:
        """Of 'file.py:name', of a function, or a UserFunction itself. Raises InputError."""
        if isinstance(given, UserFunction):
            return given
        if isinstance(given, str):
            file, _, name = given.rpartition(':')
            if not file.endswith('.py') or not name.isidentifier():
                raise InputError(
                    'not a function', key='function', value=given, expected='FILE.py:NAME'
                )
            try:
                source = paths.content(paths.named(file), LARGEST).decode('utf-8')
            except InputError as error:  # the file of a study that names it has the line
                raise InputError(str(error), key='function') from None
            except UnicodeDecodeError:
                raise InputError('not text in UTF-8', key='function', value=file) from None
            made = cls(name, source=source)
            made.called  # noqa: B018  a fault of the file shows here, and not in each member
            return made
        if not callable(given):
            raise InputError('not a function', key='function', value=given)
        name = getattr(given, '__name__', 'function')
        data = base64.b64encode(_pickled(given)).decode()
        return cls(name if name.isidentifier() else 'function', pickled=data)

    @cached_property
    def digest(self) -> str:
        """SHA-256 of its name and text; of a function that was given itself, of its code and of
        all values that it uses, as they were when it was given."""
        said = self.source or self._content
        return hashlib.sha256(f'{self.name}\0{said}'.encode()).hexdigest()

    @property
    def _content(self) -> str:
        fresh = self._unpickled()  # `called` may have changed its values since
        try:
            return function_digest(fresh)
        except (pickle.PicklingError, TypeError, AttributeError, RecursionError, ValueError):
            return self.pickled  # a value that only cloudpickle knows

    def _unpickled(self) -> Callable[[Any], Any]:
        found: Callable[[Any], Any] = pickle.loads(base64.b64decode(self.pickled))
        return found

    @cached_property
    def called(self) -> Callable[[Any], Any]:
        """The function. Raises InputError if it cannot be had."""
        if self.pickled:
            return self._unpickled()
        names: dict[str, Any] = {'__name__': f'ensemble_{self.digest[:12]}'}
        try:
            exec(compile(self.source, f'<{self.name}>', 'exec'), names)
        except (Exception, SystemExit) as error:  # whatever somebody's file raises
            text = f'{type(error).__name__}: {error}'
            raise InputError(text, key='function', value=self.name) from None
        if not callable(names.get(self.name)):
            choices = [name for name, value in names.items() if callable(value)]
            raise InputError('no such function', key='function', value=self.name, choices=choices)
        made: Callable[[Any], Any] = names[self.name]
        return made

    def __getstate__(self) -> dict[str, str]:
        return {'name': self.name, 'source': self.source, 'pickled': self.pickled}


def _pickled(function: Callable[[Any], Any]) -> bytes:
    """By reference, if a worker can import it; else by value, which needs cloudpickle."""
    module = getattr(function, '__module__', '__main__')
    try:
        if installed(module):
            return pickle.dumps(function, protocol=4)
    except (pickle.PicklingError, AttributeError, TypeError):
        pass
    try:
        import cloudpickle
    except ImportError:
        raise InputError(
            'a function that a worker cannot import needs cloudpickle',
            key='function',
            value=getattr(function, '__name__', 'function'),
            expected="'FILE.py:NAME', or pip install 'alf_ros[ensemble]'",
        ) from None
    own = sys.modules.get(module)
    by_value = own is not None and module != '__main__' and not installed(module)
    if by_value:
        cloudpickle.register_pickle_by_value(own)
    try:
        found: bytes = cloudpickle.dumps(function, protocol=4)
    except (pickle.PicklingError, TypeError) as error:
        raise InputError(
            f'cannot be given to workers: {error}', key='function', value=repr(function)
        ) from None
    finally:
        if by_value:
            cloudpickle.unregister_pickle_by_value(own)
    return found
