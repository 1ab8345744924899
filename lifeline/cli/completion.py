"""`lifeline completion`: the completion scripts of bash, zsh and fish, and the words that they complete.

A script calls `lifeline` with the words of the command line in its environment; typer answers with the matching commands,
options and values. Where it knows none, the shell completes file names. Nothing here uses the network.
"""

import tomllib
from pathlib import Path
from typing import Any

from deploy.stack.errors import DeployError

ANSWER_VARIABLE = "_LIFELINE_COMPLETE"
"""The environment variable by which a script asks for completions."""

BASH = """\
_lifeline() {
    local IFS=$'\\n'
    COMPREPLY=( $(COMP_WORDS="${COMP_WORDS[*]}" COMP_CWORD=$COMP_CWORD _LIFELINE_COMPLETE=complete_bash "$1" 2>/dev/null) )
}
complete -o default -F _lifeline lifeline"""

ZSH = """\
#compdef lifeline
_lifeline() {
    eval $(_TYPER_COMPLETE_ARGS="${words[1,$CURRENT]}" _LIFELINE_COMPLETE=complete_zsh ${(Q)words[1]} 2>/dev/null)
}
if [[ $funcstack[1] == _lifeline ]]; then
    _lifeline "$@"
else
    (( $+functions[compdef] )) || { autoload -Uz compinit && compinit }
    compdef _lifeline lifeline
fi"""

FISH = """\
function __lifeline_complete
    set -l words (commandline -opc)
    set -l found (env _TYPER_COMPLETE_ARGS=(commandline -cp | string collect) _LIFELINE_COMPLETE=complete_fish \\
        _TYPER_COMPLETE_FISH_ACTION=get-args $words[1] 2>/dev/null)
    if test -n "$found"
        printf '%s\\n' $found
    else
        __fish_complete_path (commandline -ct)
    end
end
complete --command lifeline --no-files --arguments '(__lifeline_complete)'"""

SCRIPTS = {"bash": BASH, "zsh": ZSH, "fish": FISH}


def script(shell: str) -> str:
    """Return the completion script of a shell.

    Raises:
        DeployError: there is no script for this shell.
    """
    if shell not in SCRIPTS:
        raise DeployError(f"there is no completion for {shell!r}; there is one for {', '.join(SCRIPTS)}")
    return SCRIPTS[shell]


# --- the values of options and arguments


def shells(_incomplete: str) -> list[str]:
    return list(SCRIPTS)


def topic_names(incomplete: str) -> list[str]:
    """Return the topics of a robot with the default configuration, as absolute names if the word begins like one."""
    from wire import topics  # noqa: PLC0415 - slow, and needed by this completion only

    document = _defaults()
    namespace = document["bus"]["namespace"]
    sources = [topics.source_cmd_vel(source["name"]).key for source in document["supervisor"]["sources"]]
    names = [*(topic.key for topic in topics.TOPICS if "<" not in topic.key), *sources]
    prefix = next((p for p in (f"/{namespace}/", f"{namespace}/") if _may_begin(incomplete, p)), "")
    return [f"{prefix}{name}" for name in names]


def _may_begin(incomplete: str, prefix: str) -> bool:
    return bool(incomplete) and (incomplete.startswith(prefix) or prefix.startswith(incomplete))


def node_names(_incomplete: str) -> list[str]:
    from wire import topics  # noqa: PLC0415 - slow, and needed by this completion only

    return [topics.SUPERVISOR, topics.SIM, topics.TELEOP]


def class_names(incomplete: str) -> list[str]:
    """Return the classes of faults, after the names that the word already has."""
    from faults.real.injectors.plans import real_classes  # noqa: PLC0415 - needed by this completion only

    before, comma, _ = incomplete.rpartition(",")
    return [f"{before}{comma}{one.name}" for one in real_classes()]


def layout_names(_incomplete: str) -> list[str]:
    return sorted(path.stem for path in Path(__file__).parents[2].glob("sim/layouts/*.toml"))


def hull_names(_incomplete: str) -> list[str]:
    return ["round", "rectangular"]


def camera_names(_incomplete: str) -> list[str]:
    return ["follow", "corner", "top"]


def _defaults() -> dict[str, Any]:
    return tomllib.loads((Path(__file__).parents[2] / "deploy/robot.toml").read_text(encoding="utf-8"))
