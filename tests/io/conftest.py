"""Every remedy that is printed in these tests is carried out."""

from tests.remedies import remedies_work as remedies_work
from tests.remedies import watch

watch()
