# Completion of stickslip for bash: commands, scenes, and the options and values that `stickslip COMMAND -help` lists.
_stickslip() {
  local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD - 1]} command=${COMP_WORDS[1]} program=${COMP_WORDS[0]}
  local IFS=$'\n' values=
  if ((COMP_CWORD == 1)); then
    values=$("$program" --help | sed -n '/^commands:/,/^$/s/^  \([a-z]*\) .*/\1/p')
  elif [[ $word == -* ]]; then
    values=$("$program" "$command" -help 2>/dev/null | sed -n 's/^  \(-[a-z]\w*\) .*/\1/p')
  elif [[ $before == -* ]]; then
    values=$("$program" "$command" -help 2>/dev/null | sed -n "s/^  $before \[.*\]: one of \(.*\)/\1/p" | sed 's/, */\n/g')
  fi
  if [ -n "$values" ]; then COMPREPLY=($(compgen -W "$values" -- "$word"))
  else COMPREPLY=($(compgen -f -- "$word")); fi
}
complete -o filenames -F _stickslip stickslip
