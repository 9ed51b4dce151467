"""Topics for whoever looks on: what is sent there costs nothing while nobody does."""

from __future__ import annotations

from typing import Any

# Whether anybody listens is looked at once in so many messages.
LOOKED_AT = 16


class Onlookers:
    """Those who subscribe a topic."""

    def __init__(self, publisher: Any) -> None:
        self._publisher = publisher
        self._left = 0
        self._there = False

    @property
    def there(self) -> bool:
        """Whether anybody listens; asked once for each message."""
        if self._left == 0:
            self._left = LOOKED_AT
            self._there = self._publisher.get_subscription_count() > 0
        self._left -= 1
        return self._there

    def send(self, message: Any) -> None:
        """Publish a message, or a serialised one, if anybody listens."""
        if self.there:
            self._publisher.publish(message)
