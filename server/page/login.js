// The login form: asks for a token, says what was wrong with it.

import { get, setText } from './dom.js';
import { login } from './socket.js';

export class Login {
  /** `entered()` is called when the server took a token. */
  constructor(entered) {
    this.entered = entered;
    this.form = get('login-form');
    this.token = get('token');
    this.button = get('login-button');
    this.form.addEventListener('submit', (event) => {
      event.preventDefault();
      this.enter(this.token.value.trim());
    });
  }

  /** Shows the form with a reason, if there is one. */
  show(reason = '', hint = '') {
    get('app').hidden = true;
    get('login').hidden = false;
    this.explain(reason, hint);
    this.token.focus();
  }

  hide() {
    get('login').hidden = true;
    get('app').hidden = false;
    this.token.value = '';
    this.explain('', '');
  }

  /** Tries a token; shows the form again when the server refuses it. */
  async enter(token) {
    if (!token) {
      this.show('no token', 'the server wrote one into its data folder when it started');
      return;
    }
    this.button.disabled = true;
    try {
      await login(token);
      this.hide();
      this.entered();
    } catch (error) {
      const unreachable = error instanceof TypeError;
      this.show(unreachable ? 'the server cannot be reached' : error.message, error.hint ?? '');
      this.token.select();
    } finally {
      this.button.disabled = false;
    }
  }

  explain(error, hint) {
    get('login-error').hidden = !error;
    setText(get('login-error-text'), error);
    setText(get('login-hint'), hint);
  }
}
