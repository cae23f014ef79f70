"""Whether this run has the whole night: then tests try more cases."""

import os

NIGHTLY = os.environ.get('REDRES_NIGHTLY') == '1'
