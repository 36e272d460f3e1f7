"""Build script: ament_python for colcon, and plain pip. What both must know is in package.xml."""

import runpy
from glob import glob
from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup

# Only importable after setuptools, which brings it where Python 3.12 has none.
from distutils.command.install_data import install_data  # isort: skip

NAME = 'alf_ros'
XML = ElementTree.parse('package.xml')
MAINTAINER = next(XML.iter('maintainer'))
COMMANDS = runpy.run_path(f'{NAME}/commands/__init__.py')['COMMANDS']
# There are no wheels for the other Pythons on ARM.
HAS_USD = 'platform_machine != "aarch64" or python_version >= "3.11"'
SCRIPTS = [f'{name} = {NAME}.__main__:executable' for name in COMMANDS]


class InstallData(install_data):
    """Also put an executable per command into lib/alf_ros, where `ros2 run` looks.

    For colcon setuptools has written them there (setup.cfg); pip heeds no setup.cfg and uses bin.
    """

    def run(self) -> None:
        super().run()
        folder = Path(self.install_dir) / 'lib' / NAME
        folder.mkdir(parents=True, exist_ok=True)
        for name in COMMANDS:
            if not (folder / name).exists():
                self.copy_file('scripts/executable', str(folder / name))
                self.outfiles.append(str(folder / name))


setup(
    name=NAME,
    version=XML.findtext('version'),
    description=XML.findtext('description', '').strip(),
    author=XML.findtext('author'),
    maintainer=XML.findtext('maintainer'),
    maintainer_email=MAINTAINER.get('email'),
    license=XML.findtext('license'),
    packages=find_packages(include=[NAME, f'{NAME}.*']),
    package_data={
        NAME: [
            'py.typed',
            'logs/report/page/*',
            'ros/view/page/*',
            'studies/atlas/page/*',
            'studies/statics/page/*',
        ]
    },
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{NAME}']),
        (f'share/{NAME}', ['package.xml']),
        (f'share/{NAME}/launch', glob('launch/*.launch.py')),
        (f'share/{NAME}/rviz', glob('rviz/*.rviz')),
        (f'share/{NAME}/config', glob('config/*.yaml')),
        (f'share/{NAME}/config/foxglove', glob('config/foxglove/*.json')),
        (f'share/{NAME}/config/security', glob('config/security/*.xml')),
        (f'share/{NAME}/config/ros2_control', glob('config/ros2_control/*')),
        (f'share/{NAME}/config/schema', glob('config/schema/*.json')),
        (f'share/{NAME}/config/mechanisms', glob('config/mechanisms/*.yaml')),
        (f'share/{NAME}/config/scenes', glob('config/scenes/*.yaml')),
    ],
    cmdclass={'install_data': InstallData},
    entry_points={'console_scripts': SCRIPTS},
    python_requires='>=3.10',
    install_requires=['numpy', 'scipy', 'numba', 'PyYAML'],
    extras_require={
        'record': ['mcap>=1.5', 'zstandard'],
        'plot': ['matplotlib'],
        'table': ['pandas', 'pyarrow', 'xarray'],
        'import': ['urdf-parser-py', 'mujoco', 'xacro', f'usd-core; {HAS_USD}'],
        'ensemble': ['dask', 'distributed', 'xarray', 'zarr'],
        'bags': ['rosbags'],
        'view': ['foxglove-sdk', 'trimesh', 'pycollada'],
    },
    zip_safe=False,
)
